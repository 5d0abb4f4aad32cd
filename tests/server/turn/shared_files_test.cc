// SPDX-License-Identifier: Apache-2.0
#include "server/turn/shared_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>
#include <utility>

#include "common/file/durable_file.h"
#include "common/file/private_folder.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::shared_files_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::rigcal::testing::WaitFor;
using ::testing::HasSubstr;

// Keeps documents in memory, as the database does.
class Documents {
 public:
  std::map<std::string, std::pair<int64_t, SharedDocument>> by_name;
  int64_t version = 0;
  std::string writer;
};

class FakeRoster final : public ServerRoster {
 public:
  FakeRoster(std::string id, Documents* documents) : id_(std::move(id)), documents_(*documents) {}
  const std::string& own_id() const override { return id_; }
  absl::Status Describe(ServerEntry) override { return absl::OkStatus(); }
  absl::StatusOr<Turn> LookAtTurn() override { return Turn(); }
  std::vector<ServerEntry> List() override { return {}; }
  absl::StatusOr<std::vector<SharedDocument>> ReadDocuments(int64_t* version) override {
    std::map<int64_t, SharedDocument> newer;
    for (const auto& [name, stored] : documents_.by_name) {
      if (stored.first > *version) newer.emplace(stored);
    }
    std::vector<SharedDocument> result;
    for (auto& [number, document] : newer) {
      result.push_back(document);
      *version = number;
    }
    return result;
  }
  absl::Status WriteDocuments(const std::vector<SharedDocument>& documents) override {
    if (documents_.writer != id_) return absl::FailedPreconditionError("another server writes now");
    for (const SharedDocument& document : documents) {
      documents_.by_name[document.name] = {++documents_.version, document};
    }
    return absl::OkStatus();
  }

 private:
  const std::string id_;
  Documents& documents_;
};

class SharedFilesTest : public ::testing::Test {
 protected:
  std::filesystem::path Folder(const std::string& server) const {
    return directory_.path() / server;
  }
  void Write(const std::string& server, const std::string& name, const std::string& text) const {
    const std::filesystem::path file = Folder(server) / name;
    ASSERT_THAT(MakePrivateFolder(file.parent_path()), IsOk());
    ASSERT_THAT(WriteDurableFile(file, text), IsOk());
  }
  std::string Read(const std::string& server, const std::string& name) const {
    return ReadSmallFile(Folder(server) / name).value_or("(none)");
  }

  TemporaryDirectory directory_;
  Documents documents_;
  FakeRoster roster_a_{"a", &documents_}, roster_b_{"b", &documents_};
  SharedFiles a_{Folder("a"), &roster_a_}, b_{Folder("b"), &roster_b_};
};

TEST_F(SharedFilesTest, AWaitingServerGetsWhatTheActiveOneHas) {
  documents_.writer = "a";
  const absl::StatusOr<bool> none = b_.Fetch();
  ASSERT_THAT(none, IsOk());
  EXPECT_FALSE(*none) << "nothing is published yet";
  Write("a", "agents.json", "owners");
  Write("a", "identity/ca.crt", "authority");
  Write("a", "identity/server.key", "a's own");
  ASSERT_THAT(a_.Publish(), IsOk());
  const absl::StatusOr<bool> some = b_.Fetch();
  ASSERT_THAT(some, IsOk());
  EXPECT_TRUE(*some);
  EXPECT_EQ(Read("b", "agents.json"), "owners");
  EXPECT_EQ(Read("b", "identity/ca.crt"), "authority");
  EXPECT_EQ(Read("b", "identity/server.key"), "(none)");
  Write("a", "agents.json", "other owners");
  std::filesystem::remove(Folder("a") / "identity/ca.crt");
  EXPECT_TRUE(WaitFor([&] {
    EXPECT_THAT(b_.Fetch(), IsOk());
    return Read("b", "agents.json") == "other owners" && Read("b", "identity/ca.crt") == "(none)";
  }));
}

TEST_F(SharedFilesTest, AnEmptyServerIsKnownToHavePublished) {
  documents_.writer = "a";
  ASSERT_THAT(a_.Publish(), IsOk());
  EXPECT_TRUE(b_.Fetch().value_or(false));
}

TEST_F(SharedFilesTest, WhatWasFetchedIsNotWrittenAgain) {
  documents_.writer = "a";
  Write("a", "agents.json", "owners");
  ASSERT_THAT(a_.Publish(), IsOk());
  a_.Stop();
  ASSERT_THAT(b_.Fetch(), IsOk());
  documents_.writer = "b";
  const int64_t before = documents_.by_name["agents.json"].first;
  ASSERT_THAT(b_.Publish(), IsOk());
  EXPECT_EQ(documents_.by_name["agents.json"].first, before);
}

TEST_F(SharedFilesTest, KeysOfAnotherAuthorityAreRefusedAndStay) {
  documents_.writer = "a";
  Write("a", "identity/ca.crt", "authority");
  ASSERT_THAT(a_.Publish(), IsOk());
  Write("b", "identity/ca.crt", "another one");
  EXPECT_THAT(b_.Fetch().status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("empty --data-dir")));
  EXPECT_EQ(Read("b", "identity/ca.crt"), "another one");
}

TEST_F(SharedFilesTest, AServerWithoutTheTurnWritesNothing) {
  documents_.writer = "a";
  Write("b", "agents.json", "wrong");
  EXPECT_THAT(b_.Publish(), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another")));
  EXPECT_TRUE(documents_.by_name.empty());
}

}  // namespace
}  // namespace rigcal::server::shared_files_test
