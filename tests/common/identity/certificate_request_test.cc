// SPDX-License-Identifier: Apache-2.0
#include "common/identity/certificate_request.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/pem.h>

#include <string>

#include "common/identity/openssl_handles.h"
#include "common/identity/private_key.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::certificate_request_test {
namespace {

using ::testing::HasSubstr;

// A request as somebody else would make it.
std::string ForeignRequest(EVP_PKEY* key, EVP_PKEY* signing_key) {
  const openssl::RequestPtr request(X509_REQ_new());
  const openssl::BioPtr out = openssl::WriteBio();
  if (key != nullptr) X509_REQ_set_pubkey(request.get(), key);
  X509_REQ_sign(request.get(), signing_key, EVP_sha256());
  PEM_write_bio_X509_REQ(out.get(), request.get());
  return openssl::TextOf(out);
}

TEST(CertificateRequest, SaysWhatIsAskedFor) {
  ASSERT_OK_AND_ASSIGN(const std::string key, MakePrivateKey());
  ASSERT_OK_AND_ASSIGN(const std::string pem, MakeCertificateRequest(key, "pc-1", Role::kAgent));
  ASSERT_OK_AND_ASSIGN(const rigcal::CertificateRequest request, ParseCertificateRequest(pem));
  EXPECT_EQ(request.name, "pc-1");
  EXPECT_EQ(request.role, "agent");
  EXPECT_GT(request.public_key.size(), 60u);
}

TEST(CertificateRequest, RefusesAnotherKindOfKey) {
  const openssl::KeyPtr rsa(EVP_RSA_gen(2048));
  const openssl::KeyPtr other_curve(EVP_EC_gen("P-384"));
  for (EVP_PKEY* key : {rsa.get(), other_curve.get()}) {
    EXPECT_THAT(ParseCertificateRequest(ForeignRequest(key, key)),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("P-256")));
  }
}

TEST(CertificateRequest, RefusesAMissingKey) {
  const openssl::KeyPtr key(EVP_EC_gen("P-256"));
  EXPECT_THAT(ParseCertificateRequest(ForeignRequest(nullptr, key.get())),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("certificate request")));
}

TEST(CertificateRequest, RefusesAKeyThatItsSenderDoesNotHave) {
  const openssl::KeyPtr stolen(EVP_EC_gen("P-256"));
  const openssl::KeyPtr own(EVP_EC_gen("P-256"));
  EXPECT_THAT(ParseCertificateRequest(ForeignRequest(stolen.get(), own.get())),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not signed")));
}

TEST(CertificateRequest, RefusesWhatIsNone) {
  ASSERT_OK_AND_ASSIGN(const std::string key, MakePrivateKey());
  ASSERT_OK_AND_ASSIGN(const std::string good, MakeCertificateRequest(key, "pc-1", Role::kAgent));
  for (const std::string& bad : {std::string(), std::string("hello"), key,
                                 good.substr(0, good.size() / 2), std::string(10'000, '-')}) {
    EXPECT_THAT(ParseCertificateRequest(bad),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("PEM")));
  }
}

TEST(CertificateRequest, IsNotMadeWithABadKey) {
  EXPECT_THAT(MakeCertificateRequest("no key", "pc-1", Role::kAgent),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("private key")));
}

}  // namespace
}  // namespace rigcal::testing::certificate_request_test
