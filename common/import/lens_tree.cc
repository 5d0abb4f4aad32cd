// SPDX-License-Identifier: Apache-2.0
#include "common/import/lens_tree.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <sstream>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/import/imported_rig.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

// Builds the tree of one document. An alias (*name) stands for all of what it names, so that a
// short text could mean a long one: it is nothing here.
class LensTreeBuilder : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { Put(LensNodeAt(mark)); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { Put(LensNodeAt(mark)); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                const std::string& value) override {
    LensNode node = LensNodeAt(mark);
    node.kind = LensNode::Kind::kScalar;
    node.text = value;
    Put(std::move(node));
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    Begin(mark, LensNode::Kind::kList);
  }
  void OnSequenceEnd() override { End(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    Begin(mark, LensNode::Kind::kMap);
  }
  void OnMapEnd() override { End(); }

  LensNode Take() { return std::move(root_); }

 private:
  struct Open {
    LensNode node;
    bool has_key = false;
    LensNode key;
  };

  static LensNode LensNodeAt(const YAML::Mark& mark) {
    LensNode node;
    node.line = mark.line + 1;
    return node;
  }
  void Begin(const YAML::Mark& mark, LensNode::Kind kind) {
    Open open;
    open.node = LensNodeAt(mark);
    open.node.kind = kind;
    open_.push_back(std::move(open));
  }
  void End() {
    LensNode node = std::move(open_.back().node);
    open_.pop_back();
    Put(std::move(node));
  }
  void Put(LensNode node) {
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Open& open = open_.back();
    if (open.node.kind == LensNode::Kind::kList) {
      open.node.items.push_back(std::move(node));
    } else if (!open.has_key) {
      open.key = std::move(node);
      open.has_key = true;
    } else {
      node.line = open.key.line;  // where the field begins
      open.node.fields.emplace_back(std::move(open.key.text), std::move(node));
      open.has_key = false;
    }
  }

  LensNode root_;
  std::vector<Open> open_;
};

LensNode Scalar(absl::string_view text, int line) {
  LensNode node;
  node.kind = LensNode::Kind::kScalar;
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') {
    text = text.substr(1, text.size() - 2);
  }
  node.text = std::string(text);
  node.line = line;
  return node;
}

}  // namespace

const LensNode* LensNode::Find(std::string_view name) const {
  for (const auto& [key, value] : fields) {
    if (absl::EqualsIgnoreCase(key, absl::string_view(name.data(), name.size()))) return &value;
  }
  return nullptr;
}

std::string WithoutYamlDirective(std::string text) {
  if (absl::StartsWith(text, "\xef\xbb\xbf")) text.erase(0, 3);
  if (absl::StartsWith(text, "%YAML")) text.erase(0, std::min(text.find('\n'), text.size()));
  return text;
}

absl::StatusOr<LensNode> LensTreeOfYaml(const std::string& path, const std::string& text) {
  RIGCAL_RETURN_IF_ERROR(CheckText(path, text, NestedFormat::kYaml));
  try {
    std::istringstream stream(WithoutYamlDirective(text));
    YAML::Parser parser(stream);
    LensTreeBuilder builder;
    parser.HandleNextDocument(builder);
    if (parser) {
      return ImportError(
          path, 0,
          "goes on behind its end, with a second document or with what is no YAML; a "
          "file of a camera holds one document");
    }
    return builder.Take();
  } catch (const YAML::Exception& exception) {
    return ImportError(path, exception.mark.line + 1, absl::StrCat("is not YAML: ", exception.msg));
  } catch (const std::exception& exception) {
    return ImportError(path, 0, absl::StrCat("is not YAML: ", exception.what()));
  }
}

LensNode LensTreeOfXml(const XmlElement& element) {
  const std::vector<XmlElement> children = element.Children();
  LensNode node;
  node.line = element.line();
  if (!children.empty()) {
    // The elements of a list are called "_".
    const bool is_list = children.front().name() == "_";
    node.kind = is_list ? LensNode::Kind::kList : LensNode::Kind::kMap;
    for (const XmlElement& child : children) {
      if (is_list) {
        node.items.push_back(LensTreeOfXml(child));
      } else {
        node.fields.emplace_back(child.name(), LensTreeOfXml(child));
      }
    }
    return node;
  }
  const std::string text = element.Content();
  const std::vector<absl::string_view> words =
      absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
  if (words.empty()) return node;
  if (words.size() == 1 || words.front().front() == '"') {
    return Scalar(absl::StripAsciiWhitespace(text), node.line);
  }
  node.kind = LensNode::Kind::kList;
  for (const absl::string_view word : words) node.items.push_back(Scalar(word, node.line));
  return node;
}

}  // namespace rigcal
