// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
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
  std::map<std::string, absl::Time, std::less<>> serials = {};
};

// Who has joined, in identities.json; each change is on disk when a function returns. Only
// certificates in it are accepted (AcceptedCertificates). Records are forgotten when their last
// certificate cannot be renewed any more. Not for several threads.
class IdentityRegistry {
 public:
  using Records = std::map<std::string, IdentityRecord, std::less<>>;  // by URI

  // What the file says. DATA_LOSS: it is damaged; the message says what to do.
  static absl::StatusOr<Records> Parse(const std::string& text, const std::filesystem::path& file);
  // DATA_LOSS: the file is damaged; the message says what to do.
  static absl::StatusOr<IdentityRegistry> Open(std::filesystem::path file);

  // Sorted by URI.
  std::vector<IdentityRecord> List() const;
  // Null: nobody of this URI has joined.
  const IdentityRecord* Find(std::string_view uri) const;
  // A certificate that is given out now. `joins`: by a join string, else as a renewal.
  absl::Status Record(const Certificate& certificate, bool joins, absl::Time now);
  absl::Status MarkRevoked(std::string_view uri, absl::Time now);

  // What has happened since a backup, out of which this registry is.
  struct Since {
    std::vector<std::string> joined;       // URIs that are not, or not any more, on record here
    std::vector<IdentityRecord> replaced;  // as they are here: others have joined as these since
  };
  // Takes over from the registry that it replaces: certificates that were renewed are on record,
  // and who was revoked, or was replaced by another of his name, is revoked.
  absl::StatusOr<Since> TakeChangesOf(const IdentityRegistry& replaced, absl::Time now);

 private:
  explicit IdentityRegistry(std::filesystem::path file) : file_(std::move(file)) {}

  absl::Status Save(Records records);

  std::filesystem::path file_;
  Records records_;
};

}  // namespace rigcal::server
