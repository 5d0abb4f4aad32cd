// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/known_servers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::known_servers_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(KnownServers, RefusesALowerGenerationAlsoAfterARestart) {
  const ::rigcal::testing::TemporaryDirectory directory;
  const auto file = directory.path() / "server.generation";
  {
    auto known = KnownServers::Open(file);
    ASSERT_THAT(known, IsOk());
    EXPECT_EQ(known->Last().id, "");
    EXPECT_THAT(known->Meet("pc-1:7420", {.id = "a", .generation = 1, .proof = "p\n1"}), IsOk());
    EXPECT_THAT(known->Meet("pc-2:7420", {.id = "a", .generation = 2, .proof = "p\n2"}), IsOk());
  }
  auto known = KnownServers::Open(file);
  ASSERT_THAT(known, IsOk());
  EXPECT_EQ(known->Last().generation, 2u);
  EXPECT_EQ(known->Last().proof, "p\n2");
  EXPECT_THAT(known->Meet("pc-1:7420", {.id = "a", .generation = 1, .proof = "p\n1"}),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("pc-1:7420 has generation 1"), HasSubstr("generation 2"))));
  EXPECT_THAT(known->Meet("pc-2:7420", {.id = "a", .generation = 2, .proof = "p\n2"}), IsOk());
  // Another server; and one of a release without generations.
  EXPECT_THAT(known->Meet("pc-3:7420", {.id = "b", .generation = 1, .proof = "p\n1"}), IsOk());
  EXPECT_THAT(known->Meet("pc-3:7420", {.id = "b", .generation = 0, .proof = "p\n0"}), IsOk());
}

TEST(KnownServers, TakesAProofThatComesLater) {
  const ::rigcal::testing::TemporaryDirectory directory;
  const auto file = directory.path() / "server.generation";
  std::ofstream(file) << "a 2\n";  // of a release without proofs
  auto known = KnownServers::Open(file);
  ASSERT_THAT(known, IsOk());
  EXPECT_EQ(known->Last().proof, "");
  EXPECT_THAT(known->Meet("pc-2:7420", {.id = "a", .generation = 2, .proof = "p"}), IsOk());
  // It stays where the same server gives none.
  EXPECT_THAT(known->Meet("pc-2:7420", {.id = "a", .generation = 2}), IsOk());
  EXPECT_EQ(KnownServers::Open(file)->Last().proof, "p");
}

TEST(KnownServers, ADamagedFileIsNamed) {
  const ::rigcal::testing::TemporaryDirectory directory;
  const auto file = directory.path() / "server.generation";
  for (const char* text : {"", "a", "a b", "a 2 ?"}) {
    std::ofstream(file) << text;
    EXPECT_THAT(KnownServers::Open(file),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr(file.string())))
        << text;
  }
}

}  // namespace
}  // namespace rigcal::agent::known_servers_test
