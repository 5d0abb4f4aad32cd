// SPDX-License-Identifier: Apache-2.0
#include "common/identity/certificate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_replace.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::certificate_test {
namespace {

using ::testing::HasSubstr;

class OnlyCertificate : public ::testing::Test {
 protected:
  const TestCa ca_;
  const TestCa other_;
  const std::string pem_ = ca_.certificate_pem();
};

TEST_F(OnlyCertificate, IsWrittenAnew) {
  ASSERT_OK_AND_ASSIGN(const Certificate plain, ParseOnlyCertificate(pem_));
  EXPECT_EQ(plain.pem, pem_);
  ASSERT_OK_AND_ASSIGN(const Certificate first, ParseCertificate(pem_));
  EXPECT_EQ(plain.sha256, first.sha256);
  for (const std::string& spaced :
       {"\n\n" + pem_ + " \n", absl::StrReplaceAll(pem_, {{"\n", "\r\n"}})}) {
    ASSERT_OK_AND_ASSIGN(const Certificate again, ParseOnlyCertificate(spaced));
    EXPECT_EQ(again.pem, pem_);
  }
}

TEST_F(OnlyCertificate, IsNotOneOfSeveral) {
  for (const std::string& several :
       {pem_ + other_.certificate_pem(), other_.certificate_pem() + pem_, pem_ + pem_,
        pem_ + ca_.MakeAgent("pc1").key_pem}) {
    EXPECT_THAT(ParseOnlyCertificate(several),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("holds 2 PEM blocks")));
    EXPECT_THAT(ParseCertificateFile(several),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("holds 2 PEM blocks")));
  }
  // A kind that some readers take, in the middle of a line, and cut short.
  for (const std::string& hidden :
       {absl::StrReplaceAll(other_.certificate_pem(), {{"CERTIFICATE", "TRUSTED CERTIFICATE"}}),
        " x" + other_.certificate_pem(), other_.certificate_pem().substr(0, 60)}) {
    EXPECT_FALSE(ParseOnlyCertificate(pem_ + hidden).ok()) << hidden;
    EXPECT_FALSE(ParseOnlyCertificate(hidden + pem_).ok()) << hidden;
    EXPECT_FALSE(ParseCertificateFile(pem_ + hidden).ok()) << hidden;
  }
}

TEST_F(OnlyCertificate, HasNoTextAroundIt) {
  for (const std::string& text :
       {"Certificate:\n" + pem_, pem_ + "# of our lab\n", pem_ + std::string(1, '\0')}) {
    EXPECT_THAT(ParseOnlyCertificate(text),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("other text beside")));
    ASSERT_OK_AND_ASSIGN(const Certificate in_file, ParseCertificateFile(text));
    EXPECT_EQ(in_file.pem, pem_);
  }
}

TEST_F(OnlyCertificate, IsACertificate) {
  for (const std::string& none :
       {std::string(), std::string("text"), pem_.substr(0, 100), ca_.MakeAgent("pc1").key_pem}) {
    EXPECT_THAT(ParseOnlyCertificate(none),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("is not a certificate")));
  }
}

}  // namespace
}  // namespace rigcal::testing::certificate_test
