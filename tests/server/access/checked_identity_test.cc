// SPDX-License-Identifier: Apache-2.0
#include "server/access/checked_identity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::checked_identity_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class CheckedIdentity : public ::testing::Test {
 protected:
  std::string Active(const server::CheckedIdentity& identity, const char* name) {
    std::ifstream stream(identity.active() / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::filesystem::path folder() const { return directory_.path() / "identity"; }

  TemporaryDirectory directory_;
  TestCa ca_;
};

TEST_F(CheckedIdentity, CopiesWhatBelongsTogether) {
  const TestCertificate server = ca_.MakeServer();
  ca_.WriteServerFolder(folder(), server);
  ASSERT_OK_AND_ASSIGN(const auto identity, server::CheckedIdentity::Load(folder()));
  EXPECT_EQ(Active(*identity, "ca.crt"), ca_.certificate_pem());
  EXPECT_EQ(Active(*identity, "server.crt"), server.certificate_pem);
  EXPECT_EQ(Active(*identity, "server.key"), server.key_pem);
  struct stat status {};
  ASSERT_EQ(stat((identity->active() / "server.key").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  // Else the next start warns of a folder that the server itself has opened.
  ASSERT_EQ(stat(identity->active().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0700u);
}

TEST_F(CheckedIdentity, NamesWhatIsWrongAtTheStart) {
  EXPECT_THAT(server::CheckedIdentity::Load(folder()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("ca.crt")));
  ca_.WriteServerFolder(folder(), ca_.MakeServer());
  ReplaceTestFile(folder() / "server.key", ca_.MakeServer().key_pem);
  EXPECT_THAT(server::CheckedIdentity::Load(folder()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("server.crt"), HasSubstr("private key"))));
}

TEST_F(CheckedIdentity, TakesANewCertificateOnlyWhenItIsWhole) {
  const TestCertificate old = ca_.MakeServer();
  const TestCertificate fresh = ca_.MakeServer();
  ca_.WriteServerFolder(folder(), old);
  ASSERT_OK_AND_ASSIGN(const auto identity, server::CheckedIdentity::Load(folder()));
  // In the middle of being replaced: the key of one, the certificate of the other.
  ReplaceTestFile(folder() / "server.crt", fresh.certificate_pem);
  for (int i = 0; i < 3; ++i) identity->Refresh();
  EXPECT_EQ(Active(*identity, "server.crt"), old.certificate_pem);
  EXPECT_EQ(Active(*identity, "server.key"), old.key_pem);
  ReplaceTestFile(folder() / "server.key", fresh.key_pem);
  identity->Refresh();
  EXPECT_EQ(Active(*identity, "server.crt"), fresh.certificate_pem);
  EXPECT_EQ(Active(*identity, "server.key"), fresh.key_pem);
}

TEST_F(CheckedIdentity, KeepsTheOldOneBesideBrokenFiles) {
  const TestCertificate old = ca_.MakeServer();
  ca_.WriteServerFolder(folder(), old);
  ASSERT_OK_AND_ASSIGN(const auto identity, server::CheckedIdentity::Load(folder()));
  const TestCa other;
  const TestCertificate foreign = other.MakeServer();
  for (const std::string& broken : {std::string(), std::string("x"), foreign.certificate_pem}) {
    ReplaceTestFile(folder() / "server.crt", broken);
    identity->Refresh();
    EXPECT_EQ(Active(*identity, "server.crt"), old.certificate_pem);
  }
  std::filesystem::remove(folder() / "server.crt");
  identity->Refresh();
  EXPECT_EQ(Active(*identity, "server.crt"), old.certificate_pem);
  EXPECT_THAT(identity->ca()->Identify(ca_.MakeAgent("pc1").certificate_pem, identity->Now()),
              IsOk());
}

TEST_F(CheckedIdentity, ForgetsTheCopiesOfAnEarlierRun) {
  ca_.WriteServerFolder(folder(), ca_.MakeServer());
  ASSERT_THAT(server::CheckedIdentity::Load(folder()), IsOk());
  const TestCertificate fresh = ca_.MakeServer();
  ca_.WriteServerFolder(folder(), fresh);
  ASSERT_OK_AND_ASSIGN(const auto identity, server::CheckedIdentity::Load(folder()));
  EXPECT_EQ(Active(*identity, "server.crt"), fresh.certificate_pem);
}

}  // namespace
}  // namespace rigcal::testing::checked_identity_test
