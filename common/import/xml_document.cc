// SPDX-License-Identifier: Apache-2.0
#include "common/import/xml_document.h"

#include <libxml/parser.h>
#include <libxml/tree.h>

#include <cmath>
#include <limits>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/import/imported_rig.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal {
namespace {

const xmlChar* XmlText(const char* text) { return reinterpret_cast<const xmlChar*>(text); }

}  // namespace

XmlDocument::XmlDocument(std::string path, xmlDoc* document)
    : path_(std::move(path)), document_(document, &xmlFreeDoc) {}

absl::StatusOr<XmlDocument> XmlDocument::Parse(const std::string& path, const std::string& text) {
  if (text.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
    return ImportError(path, 0, "is too large");
  }
  if (const auto line = LineNestedTooDeep(NestedFormat::kXml, text)) {
    return ImportError(path, *line, kNestedTooDeep);
  }
  const std::unique_ptr<xmlParserCtxt, decltype(&xmlFreeParserCtxt)> parser(xmlNewParserCtxt(),
                                                                            &xmlFreeParserCtxt);
  if (parser == nullptr) return absl::ResourceExhaustedError(path + ": no memory to read it");
  xmlDoc* const document =
      xmlCtxtReadMemory(parser.get(), text.data(), static_cast<int>(text.size()), nullptr, nullptr,
                        XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING);
  if (document != nullptr && xmlDocGetRootElement(document) != nullptr) {
    return XmlDocument(path, document);
  }
  if (document != nullptr) xmlFreeDoc(document);
  const xmlError* const error = xmlCtxtGetLastError(parser.get());
  const std::string why = error != nullptr && error->message != nullptr ? error->message : "";
  return ImportError(path, error != nullptr ? error->line : 0,
                     absl::StrCat("is not XML: ", absl::StripAsciiWhitespace(why)));
}

XmlElement XmlDocument::root() const {
  return XmlElement(this, xmlDocGetRootElement(document_.get()));
}

std::string XmlElement::name() const { return reinterpret_cast<const char*>(node_->name); }

int XmlElement::line() const { return static_cast<int>(xmlGetLineNo(node_)); }

absl::Status XmlElement::Error(const std::string& why) const {
  return ImportError(document_->path(), line(), absl::StrCat("<", name(), "> ", why));
}

std::vector<XmlElement> XmlElement::Children() const {
  std::vector<XmlElement> children;
  for (xmlNode* child = node_->children; child != nullptr; child = child->next) {
    if (child->type == XML_ELEMENT_NODE) children.push_back(XmlElement(document_, child));
  }
  return children;
}

std::vector<XmlElement> XmlElement::Children(const char* name) const {
  std::vector<XmlElement> children = Children();
  std::erase_if(children, [name](const XmlElement& child) { return child.name() != name; });
  return children;
}

std::string XmlElement::Content() const {
  std::string text;
  for (const xmlNode* child = node_->children; child != nullptr; child = child->next) {
    const bool is_text = child->type == XML_TEXT_NODE || child->type == XML_CDATA_SECTION_NODE;
    if (is_text && child->content != nullptr) {
      text += reinterpret_cast<const char*>(child->content);
    }
  }
  return text;
}

absl::StatusOr<XmlElement> XmlElement::Child(const char* name) const {
  const std::vector<XmlElement> children = Children(name);
  if (children.empty()) return Error(absl::StrCat("has no <", name, ">"));
  return children.front();
}

bool XmlElement::Has(const char* attribute) const {
  return xmlHasProp(node_, XmlText(attribute)) != nullptr;
}

absl::StatusOr<std::string> XmlElement::Text(const char* attribute) const {
  const std::unique_ptr<xmlChar, decltype(xmlFree)> value(xmlGetProp(node_, XmlText(attribute)),
                                                          xmlFree);
  if (value == nullptr) return Error(absl::StrCat("has no ", attribute));
  return std::string(reinterpret_cast<const char*>(value.get()));
}

absl::StatusOr<std::vector<double>> XmlElement::Numbers(const char* attribute, size_t count) const {
  RIGCAL_ASSIGN_OR_RETURN(const std::string text, Text(attribute));
  std::vector<double> values;
  for (const absl::string_view word :
       absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty())) {
    double value = NAN;
    if (!absl::SimpleAtod(word, &value) || !std::isfinite(value)) {
      return Error(absl::StrCat(attribute, " is not a list of finite numbers"));
    }
    values.push_back(value);
  }
  if (values.size() == count) return values;
  return Error(absl::StrCat(attribute, " has ", values.size(), " numbers, not ", count));
}

absl::StatusOr<double> XmlElement::Number(const char* attribute) const {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> values, Numbers(attribute, 1));
  return values[0];
}

}  // namespace rigcal
