// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace rigcal {

// How deep a text from a file or from the network may nest. Parsers, and the destructors of what
// they make, recurse once per level: 50 000 levels fit in 100 kB and end a program. Nothing that
// rigcal reads nests deeper than 12.
inline constexpr size_t kMostNested = 64;
inline constexpr char kNestedTooDeep[] = "is nested more than 64 levels deep";

enum class NestedFormat : uint8_t { kJson, kToml, kYaml, kXml };

// The line (from 1) at which a text nests deeper than kMostNested; none: it nowhere does. To be
// asked before a library parses the text, which need not be well-formed. Where a text can be read
// in two ways, the deeper one counts: in YAML a closing bracket on a line with a quote or a comment
// closes nothing.
std::optional<int> LineNestedTooDeep(NestedFormat format, std::string_view text);

// nlohmann's parse() without exceptions: a discarded value where the text is no JSON or nests too
// deep.
template <typename Json>
Json ParseJson(std::string_view text) {
  if (LineNestedTooDeep(NestedFormat::kJson, text)) return Json(Json::value_t::discarded);
  return Json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
}

}  // namespace rigcal
