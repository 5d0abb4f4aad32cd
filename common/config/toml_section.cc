// SPDX-License-Identifier: Apache-2.0
#include "common/config/toml_section.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "common/options/nearest_name.h"
#include "common/text/nesting.h"
#include "common/text/shortest_text.h"

namespace rigcal {

std::string TomlFile::PlaceOf(const toml::node& node) const {
  return absl::StrCat(path, ":", node.source().begin.line);
}

void TomlFile::AddFault(const toml::node& node, const std::string& what) {
  faults.Add(PlaceOf(node), ": ", what);
}

absl::StatusOr<TomlFile> ReadTomlFile(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return absl::NotFoundError(absl::StrCat("there is no configuration file ", path));
  }
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) return absl::UnavailableError(absl::StrCat("cannot read ", path));
  const std::string content = text.str();
  if (const auto line = LineNestedTooDeep(NestedFormat::kToml, content)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ":", *line, ": ", kNestedTooDeep));
  }
  try {
    return TomlFile{.path = path, .root = toml::parse(content, path), .faults = {}};
  } catch (const toml::parse_error& parse_error) {
    return absl::InvalidArgumentError(absl::StrCat(path, ":", parse_error.source().begin.line, ": ",
                                                   std::string(parse_error.description())));
  }
}

absl::StatusOr<OptionText> OptionOf(const TomlFile& file, std::string_view key,
                                    const toml::node& value) {
  OptionText option = {.key = std::string(key), .value = "", .where = file.PlaceOf(value)};
  if (const auto* text = value.as_string()) {
    option.value = text->get();
    option.type = OptionText::Type::kText;
  } else if (const auto* flag = value.as_boolean()) {
    option.value = flag->get() ? "1" : "0";
    option.type = OptionText::Type::kSwitch;
  } else if (const auto* whole = value.as_integer()) {
    option.value = absl::StrCat(whole->get());
    option.type = OptionText::Type::kNumber;
  } else if (const auto* number = value.as_floating_point()) {
    option.value = ShortestText(number->get());
    option.type = OptionText::Type::kNumber;
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat(option.key, " must be a number, true, false or a text"));
  }
  return option;
}

const toml::node* TomlSection::TakeNode(std::string_view key) {
  known_.emplace_back(key);
  return table_.get(key);
}

void TomlSection::Take(const OptionTable& options) {
  for (const std::string& name : options.Names()) {
    const toml::node* node = TakeNode(name);
    if (node == nullptr) continue;
    const absl::StatusOr<OptionText> option = OptionOf(*file_, name, *node);
    if (option.ok()) {
      options.ReadOne(*option, &file_->faults);
    } else {
      file_->AddFault(*node, std::string(option.status().message()));
    }
  }
}

const toml::table* TomlSection::TakeTable(std::string_view key) {
  const toml::node* node = TakeNode(key);
  if (node == nullptr) return nullptr;
  if (node->as_table() == nullptr) {
    AddFault(key, absl::StrCat("must be a table: [", std::string(key), "]"));
  }
  return node->as_table();
}

std::vector<const toml::table*> TomlSection::TakeTables(std::string_view key) {
  const toml::node* node = TakeNode(key);
  if (node == nullptr) return {};
  const toml::array* list = node->as_array();
  if (list == nullptr || !list->is_homogeneous<toml::table>()) {
    AddFault(key, absl::StrCat("must be written as [[", std::string(key), "]]"));
    return {};
  }
  std::vector<const toml::table*> tables;
  for (const toml::node& entry : *list) tables.push_back(entry.as_table());
  return tables;
}

void TomlSection::AddFault(std::string_view key, const std::string& what) {
  file_->AddFault(*table_.get(key), absl::StrCat(std::string(key), " ", what));
}

void TomlSection::RefuseOtherKeys() {
  for (const auto& [key, node] : table_) {
    const std::string_view name = key.str();
    if (std::ranges::find(known_, name) != known_.end()) continue;
    file_->AddFault(node, UnknownName("key", name, known_));
  }
}

void ReadTable(TomlFile* file, TomlSection* section, std::string_view key,
               const OptionTable& options) {
  const toml::table* table = section->TakeTable(key);
  if (table == nullptr) return;
  TomlSection own(file, *table);
  own.Take(options);
  own.RefuseOtherKeys();
}

}  // namespace rigcal
