// SPDX-License-Identifier: Apache-2.0
#include "common/config/toml_section.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal {

void TomlFile::AddFault(const toml::node& node, const std::string& what) {
  faults.push_back(absl::StrCat(path, ":", node.source().begin.line, ": ", what));
}

absl::Status TomlFile::Result() const {
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrJoin(faults, "\n"));
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
  try {
    return TomlFile{.path = path, .root = toml::parse(text.str(), path), .faults = {}};
  } catch (const toml::parse_error& parse_error) {
    return absl::InvalidArgumentError(absl::StrCat(path, ":", parse_error.source().begin.line, ": ",
                                                   std::string(parse_error.description())));
  }
}

const toml::node* TomlSection::TakeNode(std::string_view key) {
  taken_.emplace(key);
  return table_.get(key);
}

void TomlSection::AddFault(std::string_view key, const std::string& what) {
  const toml::node* node = table_.get(key);
  file_->AddFault(node == nullptr ? static_cast<const toml::node&>(table_) : *node,
                  absl::StrCat(std::string(key), " ", what));
}

bool TomlSection::Take(std::string_view key, std::string* value) {
  const toml::node* node = TakeNode(key);
  if (node == nullptr) return false;
  const auto* text = node->as_string();
  if (text == nullptr) {
    AddFault(key, "must be a text in quotes");
    return false;
  }
  *value = text->get();
  return true;
}

bool TomlSection::Take(std::string_view key, double* value) {
  const toml::node* node = TakeNode(key);
  if (node == nullptr) return false;
  const std::optional<double> number =
      node->is_number() ? node->value<double>() : std::optional<double>();
  if (!number || !std::isfinite(*number)) {
    AddFault(key, "must be a finite number");
    return false;
  }
  *value = *number;
  return true;
}

bool TomlSection::Take(std::string_view key, int64_t* value) {
  const toml::node* node = TakeNode(key);
  if (node == nullptr) return false;
  const auto* number = node->as_integer();
  if (number == nullptr) {
    AddFault(key, "must be a whole number");
    return false;
  }
  *value = number->get();
  return true;
}

bool TomlSection::Take(std::string_view key, bool* value) {
  const toml::node* node = TakeNode(key);
  if (node == nullptr) return false;
  const auto* flag = node->as_boolean();
  if (flag == nullptr) {
    AddFault(key, "must be true or false");
    return false;
  }
  *value = flag->get();
  return true;
}

void TomlSection::RefuseOtherKeys() {
  for (const auto& [key, node] : table_) {
    const std::string_view name = key.str();
    if (taken_.contains(name)) continue;
    file_->AddFault(node, absl::StrCat("unknown key ", std::string(name),
                                       " (known: ", absl::StrJoin(taken_, ", "), ")"));
  }
}

}  // namespace rigcal
