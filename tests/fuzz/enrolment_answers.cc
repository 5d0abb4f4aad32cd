// SPDX-License-Identifier: Apache-2.0
// What a server answers to who joins, or who answers in its place. The first byte, modulo 4: the
// answer to /v1/ca (0) or /v1/enrol (1), the same as the bytes of a refusal (2), servers.json (3).
//
// Stand for what is another one in each run, as PEM with its lines' ends written as in JSON in the
// answers that are JSON: @CA@ the certificate of the join string's CA, @CERT@ one of it for this
// key, @OTHER@ another CA's, @LEAF@ one of that for this key.
#include "common/enrolment/enrolment_answers.h"

#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_replace.h"
#include "common/identity/certificate_request.h"
#include "common/identity/private_key.h"
#include "server/identity/certificate_authority.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_folder.h"

namespace {

using ::rigcal::server::CertificateAuthority;

struct Identity {
  Identity() {
    const auto ca = CertificateAuthority::Open(folder.path() / "ca");
    const auto other = CertificateAuthority::Open(folder.path() / "other");
    const auto key = rigcal::MakePrivateKey();
    FUZZ_CHECK(ca.ok() && other.ok() && key.ok());
    const auto request = rigcal::ParseCertificateRequest(
        *rigcal::MakeCertificateRequest(*key, "pc-1", rigcal::Role::kAgent));
    FUZZ_CHECK(request.ok());
    const CertificateAuthority::PeerRequest peer = {rigcal::Role::kAgent, "pc-1",
                                                    request->public_key};
    join.ca_sha256 = ca->sha256();
    joined = {.ca_pem = ca->pem(),
              .certificate_pem = *ca->IssuePeer(peer, absl::Now() - absl::Hours(24 * 25)),
              .key_pem = *key,
              .grpc = {"10.0.0.5:7420"},
              .https = {"10.0.0.5:7421"}};
    plain = {{"@CA@", ca->pem()},
             {"@CERT@", *ca->IssuePeer(peer, absl::Now())},
             {"@OTHER@", other->pem()},
             {"@LEAF@", *other->IssuePeer(peer, absl::Now())}};
    for (const auto& [name, pem] : plain) {
      escaped.emplace_back(name, absl::StrReplaceAll(pem, {{"\n", "\\n"}}));
    }
  }

  rigcal::testing::FuzzFolder folder;
  rigcal::JoinString join;
  rigcal::PeerIdentity joined;
  std::vector<std::pair<std::string, std::string>> plain, escaped;
};

bool IsDocumented(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsAborted(status) ||
         absl::IsFailedPrecondition(status) || absl::IsUnauthenticated(status);
}

void CheckCa(const Identity& identity, const rigcal::HttpsAnswer& answer) {
  const auto ca = rigcal::ReadCa("10.0.0.5:7421", answer, identity.join);
  if (ca.ok()) {
    // This one, to the last byte: nothing came with it.
    FUZZ_CHECK(*ca == identity.joined.ca_pem);
  } else {
    FUZZ_CHECK(absl::IsAborted(ca.status()) || absl::IsFailedPrecondition(ca.status()));
  }
}

void CheckIssued(const Identity& identity, const rigcal::HttpsAnswer& answer) {
  rigcal::PeerIdentity read = identity.joined;
  const absl::Status status = rigcal::ReadIssued("10.0.0.5:7421", answer, &read);
  if (!status.ok()) {
    FUZZ_CHECK(answer.status != 200 || IsDocumented(status));
    FUZZ_CHECK(read == identity.joined);
    return;
  }
  FUZZ_CHECK(answer.status == 200);
  FUZZ_CHECK(rigcal::CheckIdentity(read).ok());
  FUZZ_CHECK(read.ca_pem == identity.joined.ca_pem && read.key_pem == identity.joined.key_pem);
  FUZZ_CHECK(!read.grpc.empty() && !read.https.empty());
  // What goes into its file comes out of it.
  rigcal::PeerIdentity again;
  FUZZ_CHECK(rigcal::ParseServers(rigcal::FormatServers(read), &again).ok());
  FUZZ_CHECK(again.grpc == read.grpc && again.https == read.https);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Identity identity;
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  const int kind = data[0] % 4;
  rigcal::HttpsAnswer answer{
      .status = kind == 2 ? 403u : 200u,
      .body = absl::StrReplaceAll(absl::string_view(text.data(), text.size()),
                                  kind == 0 ? identity.plain : identity.escaped),
      .server_time = {}};
  if (kind == 0) {
    CheckCa(identity, answer);
  } else if (kind == 3) {
    rigcal::PeerIdentity servers;
    const absl::Status status = rigcal::ParseServers(answer.body, &servers);
    FUZZ_CHECK(status.ok() || absl::IsInvalidArgument(status));
  } else {
    CheckIssued(identity, answer);
  }
  return 0;
}
