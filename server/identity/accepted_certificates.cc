// SPDX-License-Identifier: Apache-2.0
#include "server/identity/accepted_certificates.h"

#include <spdlog/spdlog.h>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/identity/server_identity.h"

namespace rigcal::server {

AcceptedCertificates::AcceptedCertificates(const std::filesystem::path& folder)
    : denied_(folder / "denied.json"),
      needs_record_(!HasForeignCa(folder)),
      records_(folder / "identities.json",
               [file = folder / "identities.json"](const std::string& text) {
                 return IdentityRegistry::Parse(text, file);
               }) {}

absl::StatusOr<AcceptedCertificates::Standing> AcceptedCertificates::Find(std::string_view uri,
                                                                          std::string_view serial) {
  RIGCAL_ASSIGN_OR_RETURN(const bool denied, denied_.Denies(uri, serial));
  if (denied) return Standing::kRevoked;
  if (!needs_record_) return Standing::kAccepted;
  std::lock_guard lock(mutex_);
  const absl::Status status = records_.Refresh();
  if (!status.ok() && status != logged_) {
    spdlog::error("every certificate is refused: {}", std::string(status.message()));
  }
  logged_ = status;
  RIGCAL_RETURN_IF_ERROR(status);
  const auto record = records_.content().find(uri);
  const bool found = record != records_.content().end() && record->second.serials.contains(serial);
  return found ? Standing::kAccepted : Standing::kNotOnRecord;
}

std::string WhyNotAccepted(AcceptedCertificates::Standing standing) {
  const char* const again =
      "; to let it in again, make a join string on the server's PC, and join with it";
  switch (standing) {
    case AcceptedCertificates::Standing::kRevoked:
      return absl::StrCat("was revoked", again);
    case AcceptedCertificates::Standing::kNotOnRecord:
      return absl::StrCat("is not on record here: it joined after the backup was made that was ",
                          "restored on this server, or the record was lost", again);
    case AcceptedCertificates::Standing::kAccepted:
      return "";
  }
  return "cannot be checked";
}

}  // namespace rigcal::server
