// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "absl/time/time.h"
#include "common/text/nesting.h"

namespace rigcal::server {

using IdentityJson = nlohmann::ordered_json;

// Fields of a JSON object that this server has written before. A field that is missing or of
// another type gives an empty value and makes `good` false.
class JsonFields {
 public:
  explicit JsonFields(const IdentityJson& json) : json_(json) {}

  bool good() const { return good_; }
  std::string Text(const char* key) {
    const auto field = json_.is_object() ? json_.find(key) : json_.end();
    if (field == json_.end() || !field->is_string()) {
      good_ = false;
      return "";
    }
    return field->get<std::string>();
  }
  absl::Time Time(const char* key) {
    absl::Time time;
    const std::string text = Text(key);
    if (good_ && !absl::ParseTime(absl::RFC3339_full, text, &time, nullptr)) good_ = false;
    return time;
  }
  bool Flag(const char* key) {
    const auto field = json_.is_object() ? json_.find(key) : json_.end();
    return field != json_.end() && field->is_boolean() && field->get<bool>();
  }
  bool Has(const char* key) const { return json_.is_object() && json_.contains(key); }

 private:
  const IdentityJson& json_;
  bool good_ = true;
};

inline std::string JsonTime(absl::Time time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", time, absl::UTCTimeZone());
}

}  // namespace rigcal::server
