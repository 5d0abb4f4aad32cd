// SPDX-License-Identifier: Apache-2.0
#include "server/identity/token_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::token_store_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Le;
using ::testing::Not;
using ::testing::SizeIs;

class TokenStore : public ::testing::Test {
 protected:
  TokenStore() { Open(); }

  void Open() {
    auto opened = server::TokenStore::Open(file_);
    ASSERT_THAT(opened, IsOk());
    store_ = std::make_unique<server::TokenStore>(*std::move(opened));
  }
  absl::StatusOr<server::TokenStore::Created> Create(absl::Duration ttl = absl::Hours(1)) {
    return store_->Create(Role::kAgent, ttl, "", now_);
  }
  // The secret of a token that was used.
  std::string Used(const std::string& by) {
    const auto created = Create();
    EXPECT_THAT(created, IsOk());
    EXPECT_THAT(store_->MarkUsed(created->token.id, "rigcal://agents/" + by, "key", now_), IsOk());
    return created->secret;
  }
  absl::Status Find(const std::string& secret) { return store_->Find(secret, "", now_).status(); }
  static std::string TextOf(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  absl::Time now_ = absl::FromUnixSeconds(1'795'000'000);
  TemporaryDirectory data_;
  const std::filesystem::path file_ = data_.path() / "tokens.json";
  const std::filesystem::path spent_ = data_.path() / "spent_tokens.json";
  std::unique_ptr<server::TokenStore> store_;
};

TEST_F(TokenStore, UsedOnesTakeNoPlace) {
  std::vector<std::string> secrets;
  for (size_t i = 0; i < server::kMostTokens + 100; ++i) {
    secrets.push_back(Used("pc-" + std::to_string(i)));
  }
  ASSERT_THAT(Create(), IsOk());
  EXPECT_THAT(store_->tokens(), SizeIs(Le(server::kListedSpentTokens + 2)));
  // The first have left the list, the last are in it: nobody can use any of them again.
  for (int round = 0; round < 2; ++round) {
    for (const size_t i : {size_t{0}, size_t{300}, secrets.size() - 1}) {
      EXPECT_THAT(
          Find(secrets[i]),
          StatusIs(absl::StatusCode::kPermissionDenied,
                   HasSubstr("already used, at 2026-11-18T11:06:40Z by rigcal://agents/pc-" +
                             std::to_string(i))))
          << i;
    }
    Open();  // as after a restart
  }
}

TEST_F(TokenStore, OnlyThoseThatCanBeUsedAreCounted) {
  std::string id;
  for (size_t i = 0; i < server::kMostTokens; ++i) {
    const auto created = Create(i % 2 == 0 ? absl::Hours(1) : absl::Hours(2));
    ASSERT_THAT(created, IsOk());
    id = created->token.id;
  }
  EXPECT_THAT(Create(), StatusIs(absl::StatusCode::kResourceExhausted,
                                 HasSubstr("1000 join strings that nobody has used yet")));
  ASSERT_THAT(store_->Revoke(id), IsOk());
  EXPECT_THAT(Create(), IsOk()) << "revoking helps";
  EXPECT_FALSE(Create().ok());
  now_ += absl::Hours(1);
  for (int i = 0; i < 400; ++i) EXPECT_THAT(Create(), IsOk()) << "expired ones are not counted";
}

TEST_F(TokenStore, ExpiredOnesLeaveTheListAndAreStillKnown) {
  const auto expired = Create();
  ASSERT_THAT(expired, IsOk());
  now_ += absl::Hours(24 * 9);
  ASSERT_THAT(Create(), IsOk());
  EXPECT_THAT(store_->tokens(), SizeIs(1));
  Open();
  EXPECT_THAT(Find(expired->secret),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("expired at 2026-11-18T12")));
  EXPECT_THAT(Find(std::string(16, 'x')),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("not known here")));
}

// The log of spent tokens is bounded, and a secret that has left it is as little good.
TEST_F(TokenStore, TheFilesAreBounded) {
  const std::string first = Used("the-first");
  const std::string listed = TextOf(file_);
  // As a server of years would have left them, with the longest names.
  std::string text = R"({"spent":[)";
  for (size_t i = 0; i < server::kSpentTokens; ++i) {
    text += R"({"secret_sha256":")" + std::string(60, 'a') + std::to_string(1000 + i) +
            R"(","expires":"2026-11-18T11:06:40Z","why":"was already used, at )"
            "2026-11-18T11:06:40Z by rigcal://agents/" +
            std::string(64, 'n') + R"("})" + (i + 1 < server::kSpentTokens ? "," : "]}");
  }
  data_.WriteFile("spent_tokens.json", text);
  Open();
  for (size_t i = 0; i < server::kListedSpentTokens + 10; ++i) Used(std::string(64, 'n'));
  ASSERT_THAT(Create(), IsOk());
  EXPECT_LT(std::filesystem::file_size(spent_), size_t{1} << 20) << "the limit of ReadSmallFile";
  EXPECT_LT(std::filesystem::file_size(file_), size_t{1} << 20);
  EXPECT_THAT(TextOf(spent_), HasSubstr("the-first"));
  EXPECT_THAT(TextOf(spent_), Not(HasSubstr(std::string(60, 'a') + "1000")));
  Open();
  EXPECT_FALSE(Find(first).ok());
}

// A list from a backup, in which what was used since can still be used.
TEST_F(TokenStore, WhatHasLeftTheListDoesNotComeBackWithAnOlderOne) {
  const auto created = Create();
  ASSERT_THAT(created, IsOk());
  const std::string backup = TextOf(file_);
  ASSERT_THAT(store_->MarkUsed(created->token.id, "rigcal://agents/pc-1", "key", now_), IsOk());
  for (size_t i = 0; i <= server::kListedSpentTokens; ++i) Used("pc-2");
  ASSERT_THAT(Create(), IsOk());
  ASSERT_THAT(TextOf(file_), Not(HasSubstr(created->token.id))) << "it has left the list";
  data_.WriteFile("tokens.json", backup);
  Open();
  EXPECT_THAT(Find(created->secret),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("already used")));
}

TEST_F(TokenStore, ADamagedFileIsNamed) {
  for (const char* name : {"tokens.json", "spent_tokens.json"}) {
    for (const std::string& damaged :
         {std::string("{"), std::string(R"({"tokens": [{}], "spent": [{}]})"),
          std::string(100'000, '[')}) {
      data_.WriteFile(name, damaged);
      EXPECT_THAT(server::TokenStore::Open(file_),
                  StatusIs(absl::StatusCode::kDataLoss, HasSubstr(name)));
    }
    std::filesystem::remove(data_.path() / name);
  }
}

}  // namespace
}  // namespace rigcal::testing::token_store_test
