// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/config/agent_config.h"

namespace rigcal::agent {

// What a source was told, as words: `key=value` from a source's notation or from a [[camera]] of a
// configuration file. Each Take reads a key if it is there, leaves `value` alone if not, and notes
// a fault if it cannot be read; keys that nobody took are faults too. Faults name the file and line
// where there is one.
class SourceOptions {
 public:
  SourceOptions() = default;
  // Each key at most once.
  explicit SourceOptions(std::vector<SourceOption> options);

  // "key=value" texts. INVALID_ARGUMENT quotes what is none, or a key that is there twice.
  static absl::StatusOr<SourceOptions> Split(const std::vector<std::string>& texts);

  // `option` goes before what was there under its key.
  void Override(SourceOption option);
  bool Has(std::string_view key) const;

  // A finite number of [low, high]; `meaning` goes into the message: "a number of pixels above 0".
  void Take(std::string_view key, std::string_view meaning, double low, double high, double* value);
  void Take(std::string_view key, std::string_view meaning, double low, double high,
            std::optional<double>* value);
  void Take(std::string_view key, std::string_view meaning, int low, int high, int* value);
  void Take(std::string_view key, bool* value);  // 0, 1, false, true
  void Take(std::string_view key, std::string* value);
  void TakeSpeed(double* speed);  // "speed", as ParseSpeed

  // Everything that nobody has taken yet; it counts as taken.
  std::vector<SourceOption> TakeRest();

  void AddFault(std::string_view key, const std::string& what);
  // INVALID_ARGUMENT with every fault.
  absl::Status Finish() const;

 private:
  const SourceOption* Find(std::string_view key);

  std::vector<SourceOption> options_;
  std::set<std::string, std::less<>> taken_;
  std::vector<std::string> faults_;
};

// "max" or a factor above 0. INVALID_ARGUMENT quotes the text.
absl::StatusOr<double> ParseSpeed(std::string_view text);

}  // namespace rigcal::agent
