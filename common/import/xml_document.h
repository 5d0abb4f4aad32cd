// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

struct _xmlDoc;
struct _xmlNode;

namespace rigcal {

class XmlDocument;

// An element of a document, valid as long as the document.
class XmlElement {
 public:
  std::string name() const;
  int line() const;
  // Elements directly within, of this name.
  std::vector<XmlElement> Children(const char* name) const;
  // Elements directly within, and the text that stands directly within beside them.
  std::vector<XmlElement> Children() const;
  std::string Content() const;

  // INVALID_ARGUMENT names file, line, element and attribute where it is missing, or is not so many
  // finite numbers.
  absl::StatusOr<std::string> Text(const char* attribute) const;
  absl::StatusOr<double> Number(const char* attribute) const;
  absl::StatusOr<std::vector<double>> Numbers(const char* attribute, size_t count) const;
  bool Has(const char* attribute) const;
  // The one element within of this name. INVALID_ARGUMENT: there is none.
  absl::StatusOr<XmlElement> Child(const char* name) const;
  absl::Status Error(const std::string& why) const;

 private:
  friend class XmlDocument;
  XmlElement(const XmlDocument* document, _xmlNode* node) : document_(document), node_(node) {}

  const XmlDocument* document_;
  _xmlNode* node_;
};

// A parsed XML text. Nothing is loaded from elsewhere, and no entity is replaced.
class XmlDocument {
 public:
  // INVALID_ARGUMENT: not XML; `path` and the line are named.
  static absl::StatusOr<XmlDocument> Parse(const std::string& path, const std::string& text);
  XmlElement root() const;
  const std::string& path() const { return path_; }

 private:
  XmlDocument(std::string path, _xmlDoc* document);

  std::string path_;
  std::shared_ptr<_xmlDoc> document_;
};

}  // namespace rigcal
