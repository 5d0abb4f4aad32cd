// SPDX-License-Identifier: Apache-2.0
#include "server/identity/denied_certificates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "common/file/durable_file.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::denied_certificates_test {
namespace {

using ::testing::HasSubstr;

constexpr char kPc1[] = "rigcal://agents/pc1";
constexpr char kKim[] = "rigcal://users/kim";

class DeniedCertificates : public ::testing::Test {
 protected:
  void Write(const std::string& text) { ReplaceTestFile(file_, text); }
  bool Denies(const char* uri, const char* serial) { return *denied_.Denies(uri, serial); }

  TemporaryDirectory directory_;
  const std::filesystem::path file_ = directory_.path() / "denied.json";
  server::DeniedCertificates denied_{file_};
};

TEST_F(DeniedCertificates, NoFileDeniesNobody) { EXPECT_FALSE(Denies(kPc1, "3fa2")); }

TEST_F(DeniedCertificates, ASerialDeniesOneCertificateAtOnce) {
  Write(R"({"denied": []})");
  EXPECT_FALSE(Denies(kPc1, "3fa2"));
  Write(R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": ["00:3F:A2"], "time": "x"}]})");
  EXPECT_TRUE(Denies(kPc1, "3fa2"));
  EXPECT_FALSE(Denies(kPc1, "77")) << "it has joined again";
  EXPECT_FALSE(Denies(kKim, "3fa2"));
  std::filesystem::remove(file_);
  EXPECT_FALSE(Denies(kPc1, "3fa2"));
}

TEST_F(DeniedCertificates, AnEntryWithoutSerialsDeniesAllOfThatName) {
  for (const char* text : {R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": []}]})",
                           R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": []},
                                          {"uri": "rigcal://agents/pc1", "serials": ["1"]}]})"}) {
    Write(text);
    // Also after others were added.
    for (int i = 0; i < 2; ++i) {
      EXPECT_TRUE(Denies(kPc1, "3fa2")) << text;
      EXPECT_TRUE(Denies(kPc1, "77")) << text;
      EXPECT_FALSE(Denies("rigcal://users/bob", "6")) << text;
      ASSERT_THAT(denied_.Deny(kKim, {"5"}, absl::UnixEpoch()), IsOk());
      ASSERT_THAT(denied_.Deny(kPc1, {"9"}, absl::UnixEpoch()), IsOk());
    }
  }
}

TEST_F(DeniedCertificates, WhatIsAddedCountsAtOnceForAllWhoReadTheFile) {
  server::DeniedCertificates other(file_);
  EXPECT_FALSE(*other.Denies(kPc1, "3fa2"));
  ASSERT_THAT(denied_.Deny(kPc1, {"3fa2", "77"}, absl::UnixEpoch()), IsOk());
  ASSERT_THAT(other.Deny(kKim, {"5"}, absl::UnixEpoch()), IsOk());
  EXPECT_TRUE(*other.Denies(kPc1, "77"));
  EXPECT_TRUE(Denies(kPc1, "3fa2"));
  EXPECT_TRUE(Denies(kKim, "5"));
  EXPECT_TRUE(Denies(kKim, "6")) << "also what there is no record of";
}

TEST_F(DeniedCertificates, WhoJoinsAgainIsAcceptedAndNobodyOfBefore) {
  ASSERT_THAT(denied_.Accept(kPc1, "1"), IsOk());
  EXPECT_FALSE(std::filesystem::exists(file_)) << "nobody of that name was denied";
  ASSERT_THAT(denied_.Deny(kPc1, {"1"}, absl::UnixEpoch()), IsOk());
  ASSERT_THAT(denied_.Accept(kPc1, "2"), IsOk());
  ASSERT_THAT(denied_.Accept(kPc1, "3"), IsOk());
  EXPECT_TRUE(Denies(kPc1, "1"));
  EXPECT_FALSE(Denies(kPc1, "2"));
  EXPECT_FALSE(Denies(kPc1, "3")) << "renewed";
  EXPECT_TRUE(Denies(kPc1, "4"));
  ASSERT_THAT(denied_.Deny(kPc1, {}, absl::UnixEpoch()), IsOk());
  EXPECT_TRUE(Denies(kPc1, "2"));
  EXPECT_TRUE(Denies(kPc1, "3"));
}

// Entries of earlier versions and of hands have no "all_but".
TEST_F(DeniedCertificates, TakesWhatAnotherListDenies) {
  const std::filesystem::path other_file = directory_.path() / "other.json";
  ReplaceTestFile(other_file, R"({"denied": [
      {"uri": "rigcal://agents/pc1", "serials": ["1"], "all_but": ["3", "4"]},
      {"uri": "rigcal://agents/pc2", "serials": ["1"]},
      {"uri": "rigcal://users/kim", "serials": []}]})");
  Write(R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": ["2"], "all_but": ["4", "5"]},
                       {"uri": "rigcal://agents/pc3", "serials": ["7"]}]})");
  server::DeniedCertificates other(other_file);
  ASSERT_THAT(denied_.TakeAllOf(other), IsOk());
  for (const char* serial : {"1", "2", "3", "5", "6"}) EXPECT_TRUE(Denies(kPc1, serial)) << serial;
  EXPECT_FALSE(Denies(kPc1, "4")) << "in neither";
  EXPECT_TRUE(Denies("rigcal://agents/pc2", "1"));
  EXPECT_FALSE(Denies("rigcal://agents/pc2", "2"));
  EXPECT_TRUE(Denies("rigcal://agents/pc3", "7"));
  EXPECT_TRUE(Denies(kKim, "9"));
  Write("{");
  EXPECT_THAT(denied_.TakeAllOf(other), StatusIs(absl::StatusCode::kDataLoss, HasSubstr("denied")));
}

TEST_F(DeniedCertificates, SaysThatTheFileIsDamagedUntilItIsRepaired) {
  for (const char* damaged :
       {"", "{", "[]", R"({"denied": 3})", R"({"denied": [3]})", R"({"denied": [{}]})",
        R"({"denied": [{"uri": 1, "serials": []}]})", R"({"denied": [{"uri": "a"}]})",
        R"({"denied": [{"uri": "a", "serials": [5]}]})",
        R"({"denied": [{"uri": "a", "serials": [], "all_but": 5}]})"}) {
    Write(damaged);
    const auto denies = denied_.Denies(kKim, "5");
    EXPECT_THAT(denies, StatusIs(absl::StatusCode::kDataLoss, HasSubstr("denied.json"))) << damaged;
    EXPECT_EQ(denied_.Denies(kKim, "5").status(), denies.status()) << damaged;
    EXPECT_THAT(denied_.Deny(kKim, {"5"}, absl::UnixEpoch()),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("denied.json")));
    EXPECT_EQ(*ReadSmallFile(file_), damaged) << "it is left as it is";
  }
  Write(R"({"denied": []})");
  EXPECT_FALSE(Denies(kKim, "5"));
}

// A folder in its place: an error of the file system, which can end without the file changing.
TEST_F(DeniedCertificates, SaysThatTheFileCannotBeRead) {
  std::filesystem::create_directory(file_);
  EXPECT_FALSE(denied_.Denies(kKim, "5").ok());
  std::filesystem::remove(file_);
  EXPECT_FALSE(Denies(kKim, "5"));
}

}  // namespace
}  // namespace rigcal::testing::denied_certificates_test
