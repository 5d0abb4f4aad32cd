// SPDX-License-Identifier: Apache-2.0
#include "server/identity/accepted_certificates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::accepted_certificates_test {
namespace {

using ::testing::HasSubstr;
using Standing = server::AcceptedCertificates::Standing;

constexpr char kPc1[] = "rigcal://agents/pc1";

class AcceptedCertificates : public ::testing::Test {
 protected:
  AcceptedCertificates() {
    Write("ca.crt", "");
    Write("ca.key", "");
  }
  void Write(const char* name, const std::string& text) {
    ReplaceTestFile(directory_.path() / name, text);
  }
  // On record: these serials of pc1.
  void Record(const std::string& serials) {
    Write("identities.json", R"({"identities": [{"uri": "rigcal://agents/pc1", "name": "pc1",
        "role": "agent", "joined": "2026-11-01T00:00:00Z", "expires": "2026-12-01T00:00:00Z",
        "serials": {)" + serials +
                                 "}}]}");
  }
  const TemporaryDirectory directory_;
};

TEST_F(AcceptedCertificates, NeedTheRecordOfAServerWithItsOwnCa) {
  server::AcceptedCertificates accepted(directory_.path());
  EXPECT_EQ(*accepted.Find(kPc1, "3fa2"), Standing::kNotOnRecord) << "nobody has joined";
  Record(R"("3fa2": "2026-12-01T00:00:00Z")");
  EXPECT_EQ(*accepted.Find(kPc1, "3fa2"), Standing::kAccepted);
  EXPECT_EQ(*accepted.Find(kPc1, "77"), Standing::kNotOnRecord);
  EXPECT_EQ(*accepted.Find("rigcal://agents/pc2", "3fa2"), Standing::kNotOnRecord);
  Record(R"("77": "2026-12-01T00:00:00Z")");
  EXPECT_EQ(*accepted.Find(kPc1, "3fa2"), Standing::kNotOnRecord) << "at once";
  ASSERT_THAT(accepted.denied().Deny(kPc1, {"77"}, absl::UnixEpoch()), IsOk());
  EXPECT_EQ(*accepted.Find(kPc1, "77"), Standing::kRevoked);
}

TEST_F(AcceptedCertificates, ThoseOfACaElsewhereHaveNoRecord) {
  std::filesystem::remove(directory_.path() / "ca.key");
  server::AcceptedCertificates accepted(directory_.path());
  EXPECT_EQ(*accepted.Find(kPc1, "3fa2"), Standing::kAccepted);
  Write("denied.json", R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": ["3fa2"]}]})");
  EXPECT_EQ(*accepted.Find(kPc1, "3fa2"), Standing::kRevoked);
}

TEST_F(AcceptedCertificates, NobodyIsLetInWhileAListIsDamaged) {
  server::AcceptedCertificates accepted(directory_.path());
  Record(R"("3fa2": "2026-12-01T00:00:00Z")");
  EXPECT_EQ(*accepted.Find(kPc1, "3fa2"), Standing::kAccepted);
  Write("identities.json", "{");
  EXPECT_THAT(accepted.Find(kPc1, "3fa2"),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("identities.json")));
  Record(R"("3fa2": "2026-12-01T00:00:00Z")");
  EXPECT_EQ(*accepted.Find(kPc1, "3fa2"), Standing::kAccepted);
  Write("denied.json", "{");
  EXPECT_THAT(accepted.Find(kPc1, "3fa2"),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("denied.json")));
}

}  // namespace
}  // namespace rigcal::testing::accepted_certificates_test
