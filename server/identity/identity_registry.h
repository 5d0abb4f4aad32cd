// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/identity/certificate.h"

namespace rigcal::server {

// An agent or user who has joined.
struct IdentityRecord {
  std::string uri = {};  // rigcal://agents/NAME
  std::string name = {};
  Role role = Role::kAgent;
  absl::Time joined = {};
  absl::Time expires = {};  // of the newest certificate
  std::optional<absl::Time> revoked = {};
  // Of every certificate that may still be in use, with its end.
  std::map<std::string, absl::Time> serials = {};
};

// Who has joined, in identities.json; each change is on disk when a function returns. Records are
// forgotten when their last certificate cannot be renewed any more. Not for several threads.
class IdentityRegistry {
 public:
  // DATA_LOSS: the file is damaged; the message says what to do.
  static absl::StatusOr<IdentityRegistry> Open(std::filesystem::path file);

  // Sorted by URI.
  std::vector<IdentityRecord> List() const;
  // Null: nobody of this URI has joined.
  const IdentityRecord* Find(std::string_view uri) const;
  // A certificate that is given out now. `joins`: by a join string, else as a renewal.
  absl::Status Record(const Certificate& certificate, bool joins, absl::Time now);
  absl::Status MarkRevoked(std::string_view uri, absl::Time now);

 private:
  using Records = std::map<std::string, IdentityRecord>;

  explicit IdentityRegistry(std::filesystem::path file) : file_(std::move(file)) {}

  absl::Status Save(Records records);

  std::filesystem::path file_;
  Records records_;
};

}  // namespace rigcal::server
