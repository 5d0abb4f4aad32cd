// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/import/xml_document.h"

namespace rigcal {

// A value of a file of fields, whatever it is written in.
struct LensNode {
  enum class Kind { kNone, kScalar, kList, kMap };
  Kind kind = Kind::kNone;
  std::string text;             // of a scalar
  std::vector<LensNode> items;  // of a list
  std::vector<std::pair<std::string, LensNode>> fields;
  int line = 0;

  // The field of this name, capitals or not; null: there is none, or it is no map.
  const LensNode* Find(std::string_view name) const;
};

// YAML, with or without OpenCV's line %YAML:1.0, or JSON, which is YAML, too. INVALID_ARGUMENT
// names file and line: no YAML, nested too deep, or several documents.
absl::StatusOr<LensNode> LensTreeOfYaml(const std::string& path, const std::string& text);

// An element of OpenCV's XML. Words of a text are a list.
LensNode LensTreeOfXml(const XmlElement& element);

// The text without the directive, which a parser of YAML need not take, on the same lines.
std::string WithoutYamlDirective(std::string text);

}  // namespace rigcal
