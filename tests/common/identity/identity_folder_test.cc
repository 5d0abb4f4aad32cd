// SPDX-License-Identifier: Apache-2.0
#include "common/identity/identity_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <string>

#include "common/identity/certificate_request.h"
#include "common/identity/private_key.h"
#include "server/identity/certificate_authority.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::identity_folder_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class IdentityFolder : public ::testing::Test {
 protected:
  PeerIdentity MakeIdentity(const std::string& name) {
    const auto ca = server::CertificateAuthority::Open(temporary_.path() / "ca");
    const std::string key = *MakePrivateKey();
    const auto request = ParseCertificateRequest(*MakeCertificateRequest(key, name, Role::kAgent));
    return {
        .ca_pem = ca->pem(),
        .certificate_pem = *ca->IssuePeer({Role::kAgent, name, request->public_key}, absl::Now()),
        .key_pem = key,
        .grpc = {"10.0.0.5:7420"},
        .https = {"10.0.0.5:7421"}};
  }
  static mode_t ModeOf(const std::filesystem::path& path) {
    struct stat status {};
    EXPECT_EQ(stat(path.c_str(), &status), 0) << path;
    return status.st_mode & 0777;
  }

  TemporaryDirectory temporary_;
  const rigcal::IdentityFolder folder_ = rigcal::IdentityFolder::OfAgent(temporary_.path() / "pc");
};

TEST_F(IdentityFolder, HoldsAnIdentityForItsOwnerOnly) {
  EXPECT_THAT(folder_.Load(), StatusIs(absl::StatusCode::kNotFound, HasSubstr("identity")));
  const PeerIdentity identity = MakeIdentity("pc-1");
  ASSERT_THAT(folder_.Replace(identity), IsOk());
  ASSERT_OK_AND_ASSIGN(const PeerIdentity loaded, folder_.Load());
  EXPECT_EQ(loaded, identity);
  EXPECT_EQ(ModeOf(folder_.path()), 0700u);
  for (const char* file : {"ca.crt", "agent.crt", "agent.key", "servers.json"}) {
    EXPECT_EQ(ModeOf(folder_.path() / file), 0600u) << file;
  }
}

TEST_F(IdentityFolder, ReplacesAllFilesTogether) {
  ASSERT_THAT(folder_.Replace(MakeIdentity("pc-1")), IsOk());
  const PeerIdentity second = MakeIdentity("pc-2");
  ASSERT_THAT(folder_.Replace(second), IsOk());
  ASSERT_OK_AND_ASSIGN(const PeerIdentity loaded, folder_.Load());
  EXPECT_EQ(loaded, second);
  EXPECT_FALSE(std::filesystem::exists(folder_.path().string() + ".new"));
}

TEST_F(IdentityFolder, KeepsTheOldWhereTheNewIsWrong) {
  const PeerIdentity good = MakeIdentity("pc-1");
  ASSERT_THAT(folder_.Replace(good), IsOk());
  PeerIdentity other_key = MakeIdentity("pc-1");
  other_key.key_pem = *MakePrivateKey();
  EXPECT_THAT(folder_.Replace(other_key),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("do not belong together")));
  PeerIdentity damaged = good;
  damaged.certificate_pem.resize(100);
  EXPECT_FALSE(folder_.Renew(damaged).ok());
  PeerIdentity other_ca = good;
  TemporaryDirectory elsewhere;
  other_ca.ca_pem = server::CertificateAuthority::Open(elsewhere.path())->pem();
  EXPECT_THAT(folder_.Renew(other_ca),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("another CA has signed it")));
  ASSERT_OK_AND_ASSIGN(const PeerIdentity loaded, folder_.Load());
  EXPECT_EQ(loaded, good);
}

// A certificate beside the CA's would be trusted as much.
TEST_F(IdentityFolder, TrustsOneCertificateOnly) {
  const PeerIdentity good = MakeIdentity("pc-1");
  TemporaryDirectory elsewhere;
  const std::string other = server::CertificateAuthority::Open(elsewhere.path())->pem();
  for (const std::string& several :
       {good.ca_pem + other, other + good.ca_pem, good.ca_pem + good.ca_pem,
        good.ca_pem + good.certificate_pem, good.ca_pem + "text\n"}) {
    PeerIdentity identity = good;
    identity.ca_pem = several;
    EXPECT_THAT(CheckIdentity(identity), StatusIs(absl::StatusCode::kFailedPrecondition,
                                                  HasSubstr("the CA's certificate holds")));
    EXPECT_FALSE(folder_.Replace(identity).ok());
    EXPECT_FALSE(folder_.Exists());
    identity = good;
    identity.certificate_pem = good.certificate_pem + other;
    EXPECT_FALSE(CheckIdentity(identity).ok());
  }
}

// As earlier versions may have left it.
TEST_F(IdentityFolder, AFolderThatTrustsTwoIsNamed) {
  const PeerIdentity good = MakeIdentity("pc-1");
  TemporaryDirectory elsewhere;
  const std::string other = server::CertificateAuthority::Open(elsewhere.path())->pem();
  for (const auto& [file, text] :
       {std::pair<const char*, std::string>{"ca.crt", good.ca_pem + other},
        {"ca.crt", other + good.ca_pem},
        {"agent.crt", good.certificate_pem + other}}) {
    ASSERT_THAT(folder_.Replace(good), IsOk());
    std::ofstream(folder_.path() / file, std::ios::trunc) << text;
    EXPECT_THAT(folder_.Load(), StatusIs(absl::StatusCode::kFailedPrecondition,
                                         AllOf(HasSubstr(folder_.path().string()), HasSubstr(file),
                                               HasSubstr("holds 2 PEM blocks"),
                                               HasSubstr("rigcal-agent join STRING"))));
  }
  ASSERT_THAT(folder_.Replace(good), IsOk());
  std::ofstream(folder_.path() / "ca.crt", std::ios::trunc) << "Our lab:\n" << good.ca_pem;
  ASSERT_OK_AND_ASSIGN(const PeerIdentity loaded, folder_.Load());
  EXPECT_EQ(loaded, good) << "text does no harm, and is left out";
}

TEST_F(IdentityFolder, SaysWhatIsDamaged) {
  const PeerIdentity good = MakeIdentity("pc-1");
  for (const char* file : {"ca.crt", "agent.crt", "agent.key", "servers.json"}) {
    ASSERT_THAT(folder_.Replace(good), IsOk());
    std::ofstream(folder_.path() / file, std::ios::trunc) << "{]";
    EXPECT_THAT(folder_.Load(), StatusIs(absl::StatusCode::kFailedPrecondition,
                                         HasSubstr("rigcal-agent join STRING --force")))
        << file;
  }
  ASSERT_THAT(folder_.Replace(good), IsOk());
  std::filesystem::remove(folder_.path() / "agent.key");
  EXPECT_THAT(folder_.Load(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("agent.key")));
}

}  // namespace
}  // namespace rigcal::testing::identity_folder_test
