// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/enrolment_answers.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/identity/certificate.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal {
namespace {

using AnswerJson = nlohmann::ordered_json;

// What the server says of a request that it refuses.
absl::Status RefusalOf(const std::string& address, const HttpsAnswer& answer) {
  const auto json = ParseJson<AnswerJson>(answer.body);
  if (!json.is_object() || !json.contains("code") || !json["code"].is_string() ||
      !json.contains("message") || !json["message"].is_string()) {
    return absl::AbortedError(absl::StrCat("the server at ", address, " answered with HTTP ",
                                           answer.status,
                                           ": it is another program or another version"));
  }
  absl::StatusCode code = absl::StatusCode::kInternal;
  const std::string name = json["code"].get<std::string>();
  for (const absl::StatusCode known :
       {absl::StatusCode::kInvalidArgument, absl::StatusCode::kUnauthenticated,
        absl::StatusCode::kPermissionDenied, absl::StatusCode::kAlreadyExists,
        absl::StatusCode::kResourceExhausted, absl::StatusCode::kUnavailable}) {
    if (absl::StatusCodeToString(known) == name) code = known;
  }
  return absl::Status(code, json["message"].get<std::string>());
}

absl::Status NotAlone(const std::string& address, const absl::Status& fault) {
  return absl::FailedPreconditionError(
      absl::StrCat("the answer of ", address, " to /v1/ca ", std::string(fault.message()),
                   ": whoever answers there wants to be trusted beside the server of the join "
                   "string. Nothing was sent to it. Find out who answers at this address before "
                   "this PC joins; the join string stays good"));
}

}  // namespace

absl::StatusOr<std::string> ReadCa(const std::string& address, const HttpsAnswer& answer,
                                   const JoinString& join) {
  if (answer.status != 200 || !ParseCertificate(answer.body).ok()) {
    return absl::AbortedError(
        absl::StrCat("at ", address, " is no rigcal server: it shows no certificate of a CA"));
  }
  const absl::StatusOr<Certificate> ca = ParseOnlyCertificate(answer.body);
  if (!ca.ok()) return NotAlone(address, ca.status());
  if (ca->sha256 == join.ca_sha256) return ca->pem;
  return absl::FailedPreconditionError(absl::StrCat(
      "the server at ", address, " is not the one that made the join string: its CA is ",
      absl::BytesToHexString(ca->sha256.substr(0, 8)), "..., that of the string ",
      absl::BytesToHexString(join.ca_sha256.substr(0, 8)),
      "... Nothing was sent to it. Either the server was set up anew since (make a new join "
      "string), or somebody else answers at its address"));
}

absl::Status ReadIssued(const std::string& address, const HttpsAnswer& answer,
                        PeerIdentity* identity) {
  if (answer.status != 200) return RefusalOf(address, answer);
  const auto json = ParseJson<AnswerJson>(answer.body);
  if (!json.is_object() || !json.contains("certificate") || !json["certificate"].is_string()) {
    return absl::AbortedError(
        absl::StrCat("the answer of the server at ", address, " holds no certificate"));
  }
  const absl::StatusOr<Certificate> certificate =
      ParseOnlyCertificate(json["certificate"].get<std::string>());
  if (!certificate.ok()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the certificate in the answer of the server at ", address, " ",
                     std::string(certificate.status().message()), "; is it of another version?"));
  }
  PeerIdentity issued = *identity;
  issued.certificate_pem = certificate->pem;
  if (const absl::Status servers = ParseServers(answer.body, &issued); !servers.ok()) {
    return absl::AbortedError(absl::StrCat("the answer of the server at ", address, ": ",
                                           std::string(servers.message())));
  }
  // A server whose network has just gone knows none of its addresses.
  if (issued.grpc.empty()) issued.grpc = identity->grpc;
  if (issued.https.empty()) issued.https = identity->https;
  RIGCAL_RETURN_IF_ERROR(CheckIdentity(issued));
  *identity = std::move(issued);
  return absl::OkStatus();
}

}  // namespace rigcal
