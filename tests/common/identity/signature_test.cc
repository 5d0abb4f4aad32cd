// SPDX-License-Identifier: Apache-2.0
#include "common/identity/signature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "server/identity/generation_proof.h"
#include "server/identity/server_identity.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::signature_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;

TEST(Signature, OfOtherBytesOrAnotherKeyIsRefused) {
  const ::rigcal::testing::TemporaryDirectory data, other;
  ASSERT_THAT(server::EnsureServerIdentity(data.path(), {"pc"}), IsOk());
  ASSERT_THAT(server::EnsureServerIdentity(other.path(), {"pc"}), IsOk());
  const std::filesystem::path folder = server::IdentityDirectory(data.path());
  ASSERT_OK_AND_ASSIGN(const std::string proof, server::ProveGeneration(folder, "id", 2));
  EXPECT_THAT(server::CheckGenerationProof(folder, "id", 2, proof), IsOk());

  std::string changed = proof;
  changed.back() = static_cast<char>(changed.back() ^ 1);
  const std::filesystem::path elsewhere = server::IdentityDirectory(other.path());
  ASSERT_OK_AND_ASSIGN(const std::string others, server::ProveGeneration(elsewhere, "id", 2));
  for (const absl::Status& status : {server::CheckGenerationProof(folder, "id", 3, proof),
                                     server::CheckGenerationProof(folder, "other", 2, proof),
                                     server::CheckGenerationProof(folder, "id", 2, changed),
                                     server::CheckGenerationProof(folder, "id", 2, others),
                                     server::CheckGenerationProof(folder, "id", 2, "")}) {
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kUnauthenticated, ::testing::_));
  }
}

TEST(Signature, AServerWithoutKeysProvesAndAsksForNothing) {
  const ::rigcal::testing::TemporaryDirectory data;
  for (const std::filesystem::path& folder : {std::filesystem::path(), data.path()}) {
    ASSERT_OK_AND_ASSIGN(const std::string proof, server::ProveGeneration(folder, "id", 2));
    EXPECT_EQ(proof, "");
    EXPECT_THAT(server::CheckGenerationProof(folder, "id", 3, ""), IsOk());
  }
}

TEST(Signature, ATextThatIsNoKeyCannotSign) {
  EXPECT_THAT(Sign("no key", "text"), StatusIs(absl::StatusCode::kInternal, ::testing::_));
  EXPECT_THAT(CheckSignature("no certificate", "text", "signature"),
              StatusIs(absl::StatusCode::kUnauthenticated, ::testing::_));
}

}  // namespace
}  // namespace rigcal::signature_test
