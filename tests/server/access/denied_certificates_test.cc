// SPDX-License-Identifier: Apache-2.0
#include "server/access/denied_certificates.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::denied_certificates_test {
namespace {

const server::Peer kPc1{.has_certificate = true,
                        .role = server::Role::kAgent,
                        .name = "pc1",
                        .uri = "rigcal://agents/pc1",
                        .serial = "3fa2"};
const server::Peer kPc1Again{.has_certificate = true,
                             .role = server::Role::kAgent,
                             .name = "pc1",
                             .uri = "rigcal://agents/pc1",
                             .serial = "77"};
const server::Peer kKim{.has_certificate = true,
                        .role = server::Role::kViewer,
                        .name = "kim",
                        .uri = "rigcal://users/kim",
                        .serial = "5"};

class DeniedCertificates : public ::testing::Test {
 protected:
  void Write(const std::string& text) { ReplaceTestFile(file_, text); }

  TemporaryDirectory directory_;
  const std::filesystem::path file_ = directory_.path() / "denied.json";
  server::DeniedCertificates denied_{file_};
};

TEST_F(DeniedCertificates, NoFileDeniesNobody) { EXPECT_FALSE(denied_.Denies(kPc1)); }

TEST_F(DeniedCertificates, ASerialDeniesOneCertificateAtOnce) {
  Write(R"({"denied": []})");
  EXPECT_FALSE(denied_.Denies(kPc1));
  Write(R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": ["00:3F:A2"], "time": "x"}]})");
  EXPECT_TRUE(denied_.Denies(kPc1));
  EXPECT_FALSE(denied_.Denies(kPc1Again)) << "it has joined again";
  EXPECT_FALSE(denied_.Denies(kKim));
  EXPECT_FALSE(denied_.Denies({})) << "this machine";
  std::filesystem::remove(file_);
  EXPECT_FALSE(denied_.Denies(kPc1));
}

TEST_F(DeniedCertificates, AnEntryWithoutSerialsDeniesAllOfThatName) {
  Write(R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": []}]})");
  EXPECT_TRUE(denied_.Denies(kPc1));
  EXPECT_TRUE(denied_.Denies(kPc1Again));
  EXPECT_FALSE(denied_.Denies(kKim));
}

TEST_F(DeniedCertificates, ADamagedFileDeniesEverybodyUntilItIsRepaired) {
  for (const char* damaged : {"", "{", "[]", R"({"denied": 3})", R"({"denied": [{}]})",
                              R"({"denied": [{"uri": 1, "serials": []}]})",
                              R"({"denied": [{"uri": "a", "serials": [5]}]})"}) {
    Write(damaged);
    EXPECT_TRUE(denied_.Denies(kKim)) << damaged;
    EXPECT_FALSE(denied_.Denies({})) << damaged;
  }
  Write(R"({"denied": []})");
  EXPECT_FALSE(denied_.Denies(kKim));
}

}  // namespace
}  // namespace rigcal::testing::denied_certificates_test
