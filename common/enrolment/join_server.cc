// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/join_server.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/enrolment/enrolment_answers.h"
#include "common/enrolment/https_call.h"
#include "common/identity/certificate.h"
#include "common/identity/certificate_request.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

using EnrolmentJson = nlohmann::ordered_json;

// Sends what only the server may see; it is verified with the identity's CA.
absl::Status AskForCertificate(const std::string& address, const std::string& path,
                               const EnrolmentJson& body, std::chrono::milliseconds timeout,
                               PeerIdentity* identity) {
  RIGCAL_ASSIGN_OR_RETURN(const HttpsAnswer answer, CallHttps({.address = address,
                                                               .method = "POST",
                                                               .path = path,
                                                               .body = body.dump(),
                                                               .ca_pem = identity->ca_pem,
                                                               .timeout = timeout}));
  return ReadIssued(address, answer, identity);
}

absl::StatusOr<std::string> FetchCa(const std::string& address, const JoinString& join,
                                    std::chrono::milliseconds timeout) {
  RIGCAL_ASSIGN_OR_RETURN(
      const HttpsAnswer answer,
      CallHttps({.address = address, .method = "GET", .path = "/v1/ca", .timeout = timeout}));
  return ReadCa(address, answer, join);
}

// Hosts that cannot be reached (kUnavailable) and those where another program answers (kAborted)
// are passed over; any other answer counts.
template <typename Try>
absl::Status TryInTurn(const std::vector<std::string>& addresses, const Try& attempt) {
  std::vector<std::string> faults;
  bool all_answered = !addresses.empty();
  for (const std::string& address : addresses) {
    const absl::Status status = attempt(address);
    if (!absl::IsUnavailable(status) && !absl::IsAborted(status)) return status;
    all_answered &= absl::IsAborted(status);
    faults.emplace_back(status.message());
  }
  return absl::UnavailableError(absl::StrCat(
      absl::StrJoin(faults, "; "), ". ",
      all_answered ? "Another program has this address and port: is the address right, and does "
                     "rigcal-server run there?"
                   : "Is rigcal-server running, and does the firewall of its PC let TCP 7420 and "
                     "7421 in?"));
}

}  // namespace

absl::StatusOr<PeerIdentity> JoinServer(const JoinString& join, const std::string& name,
                                        std::chrono::milliseconds timeout) {
  PeerIdentity identity;
  RIGCAL_ASSIGN_OR_RETURN(identity.key_pem, MakePrivateKey());
  RIGCAL_ASSIGN_OR_RETURN(const std::string csr,
                          MakeCertificateRequest(identity.key_pem, name, join.role));
  const EnrolmentJson body = {{"secret", absl::WebSafeBase64Escape(join.secret)}, {"csr", csr}};
  const auto join_at = [&](const std::string& address) -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(identity.ca_pem, FetchCa(address, join, timeout));
    RIGCAL_RETURN_IF_ERROR(AskForCertificate(address, "/v1/enrol", body, timeout, &identity));
    // The host that answered is the first to be asked from now on.
    const std::string host = address.substr(0, address.rfind(':') + 1);
    for (std::vector<std::string>* list : {&identity.grpc, &identity.https}) {
      std::ranges::stable_partition(
          *list, [&](const std::string& entry) { return entry.rfind(host, 0) == 0; });
    }
    return absl::OkStatus();
  };
  RIGCAL_RETURN_IF_ERROR(TryInTurn(HostPorts(join.hosts, join.https_port), join_at));
  return identity;
}

bool IsRenewalDue(const PeerIdentity& identity, absl::Time now) {
  const absl::StatusOr<Certificate> certificate = ParseCertificate(identity.certificate_pem);
  if (!certificate.ok()) return false;
  const absl::Duration life = certificate->not_after - certificate->not_before;
  return now < certificate->not_before || now >= certificate->not_before + life * 2 / 3;
}

absl::StatusOr<std::optional<PeerIdentity>> RenewIdentity(const PeerIdentity& identity,
                                                          std::chrono::milliseconds timeout) {
  RIGCAL_ASSIGN_OR_RETURN(const Certificate certificate,
                          ParseCertificate(identity.certificate_pem));
  RIGCAL_ASSIGN_OR_RETURN(const std::string csr,
                          MakeCertificateRequest(identity.key_pem, certificate.name,
                                                 certificate.role.value_or(Role::kViewer)));
  const EnrolmentJson body = {{"certificate", identity.certificate_pem}, {"csr", csr}};
  PeerIdentity renewed = identity;
  RIGCAL_RETURN_IF_ERROR(TryInTurn(identity.https, [&](const std::string& address) {
    return AskForCertificate(address, "/v1/renew", body, timeout, &renewed);
  }));
  RIGCAL_ASSIGN_OR_RETURN(const Certificate answered, ParseCertificate(renewed.certificate_pem));
  if (answered.sha256 == certificate.sha256) return std::nullopt;
  return renewed;
}

absl::Status KeepRenewed(const IdentityFolder& folder, std::chrono::milliseconds timeout) {
  constexpr absl::Duration kAskEvery = absl::Hours(24);
  constexpr absl::Duration kAskWhereDue = absl::Minutes(1);
  RIGCAL_ASSIGN_OR_RETURN(const PeerIdentity identity, folder.Load());
  const std::optional<absl::Time> asked = folder.Asked();
  // A time ahead of now: the clock was set back.
  const absl::Duration age =
      asked ? absl::AbsDuration(absl::Now() - *asked) : absl::InfiniteDuration();
  if (age < (IsRenewalDue(identity) ? kAskWhereDue : kAskEvery)) return absl::OkStatus();
  // A server that does not answer is not asked again with each command.
  folder.NoteAsked();
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<PeerIdentity> renewed,
                          RenewIdentity(identity, timeout));
  return renewed ? folder.Renew(*renewed) : absl::OkStatus();
}

}  // namespace rigcal
