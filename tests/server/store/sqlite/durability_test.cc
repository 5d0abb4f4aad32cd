// SPDX-License-Identifier: Apache-2.0
// Acknowledged rows survive kill -9 of the process at any instant, and are stored once.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::durability_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::TemporaryDirectory;

constexpr int kKills = 40;
constexpr uint32_t kBatchRows = 16;

struct Acknowledgement {
  uint32_t camera = 0;
  uint32_t durable_seq = 0;
};

const std::vector<std::string>& Cameras() {
  static const std::vector<std::string> cameras = {"a", "b", "c"};
  return cameras;
}

// Child: appends without end and writes each acknowledgement to the pipe. Never returns.
[[noreturn]] void AppendUntilKilled(const SqliteStoreOptions& options, int pipe_fd) {
  auto store = SqliteStore::Open(options);
  if (!store.ok()) _exit(3);
  std::vector<uint32_t> durable;
  for (const std::string& camera : Cameras()) {
    const auto status = (*store)->GetStream(KeyOf(camera));
    if (!status.ok()) _exit(4);
    durable.push_back(status->durable_seq);
  }
  for (;;) {  // ends with SIGKILL, or with SIGPIPE when the test is gone
    std::vector<Delivery> deliveries;
    for (size_t camera = 0; camera < Cameras().size(); ++camera) {
      // Some of it again, as after a reconnection.
      const uint32_t first = durable[camera] > 20 ? durable[camera] - 5 : durable[camera] + 1;
      deliveries.push_back(
          MakeDelivery(MakeBatch(KeyOf(Cameras()[camera]), first, first + kBatchRows)));
    }
    const auto outcomes = (*store)->Append(deliveries);
    if (!outcomes.ok()) _exit(5);
    for (uint32_t camera = 0; camera < outcomes->size(); ++camera) {
      durable[camera] = (*outcomes)[camera].durable_seq;
      const Acknowledgement ack{.camera = camera, .durable_seq = durable[camera]};
      if (write(pipe_fd, &ack, sizeof(ack)) != sizeof(ack)) _exit(6);
    }
  }
}

class Durability : public ::testing::Test {
 protected:
  void SetUp() override {
    options_.data_directory = directory_.path();
    options_.reserve_bytes = 0;
    options_.checkpoint_bytes = 64 << 10;  // often, so that some die in it
    ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(options_));
    ASSERT_THAT(store->CreateSession(CapturingSession(Cameras())), IsOk());
  }

  // Lets a child append until it has sent `ack_count` acknowledgements and then some microseconds.
  void KillAfter(int ack_count, unsigned delay_us) {
    int fds[2] = {-1, -1};
    ASSERT_EQ(pipe2(fds, O_CLOEXEC), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) AppendUntilKilled(options_, fds[1]);
    close(fds[1]);
    Acknowledgement ack;
    int seen = 0;
    while (seen < ack_count && read(fds[0], &ack, sizeof(ack)) == sizeof(ack)) {
      Note(ack);
      ++seen;
    }
    usleep(delay_us);  // no synchronization: kills at another point of a commit each time
    kill(child, SIGKILL);
    while (read(fds[0], &ack, sizeof(ack)) == sizeof(ack)) Note(ack);
    close(fds[0]);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child ended by itself, " << WEXITSTATUS(status);
  }

  void Note(const Acknowledgement& ack) {
    acknowledged_[Cameras().at(ack.camera)] =
        std::max(acknowledged_[Cameras().at(ack.camera)], ack.durable_seq);
  }

  // Rows of each camera are 1, 2, 3, ... without a gap or a repetition, at least as far as was
  // acknowledged, with the right values and counts.
  void CheckStored() {
    ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(options_));
    std::map<std::string, uint32_t> stored;
    for (const auto& [key, row] : ReadRows(*store)) {
      uint32_t& last = stored[std::get<0>(key)];
      ASSERT_EQ(std::get<2>(key), ++last);
    }
    for (const auto& [camera, durable_seq] : acknowledged_) {
      EXPECT_GE(stored[camera], durable_seq) << camera;
    }
    ASSERT_OK_AND_ASSIGN(const auto counts, store->GetSessionCounts("s-test"));
    for (const SessionCameraCounts& camera : counts) {
      EXPECT_EQ(camera.observation_count, stored[camera.camera]);
      ASSERT_EQ(camera.streams.size(), 1u);
      EXPECT_EQ(camera.streams[0].durable_seq, stored[camera.camera]);
    }
  }

  TemporaryDirectory directory_;
  SqliteStoreOptions options_;
  std::map<std::string, uint32_t> acknowledged_;
};

TEST_F(Durability, LosesNothingAcknowledgedAndStoresNothingTwiceWhenKilled) {
  std::mt19937 random(20);
  for (int kill = 0; kill < kKills && !HasFailure(); ++kill) {
    const int ack_count = 1 + static_cast<int>(random() % 90);
    const unsigned delay_us = static_cast<unsigned>(random() % 2000);
    SCOPED_TRACE(::testing::Message() << "kill " << kill << " after " << ack_count
                                      << " acknowledgements and " << delay_us << " us");
    KillAfter(ack_count, delay_us);
    CheckStored();
  }
  EXPECT_EQ(acknowledged_.size(), Cameras().size());
}

}  // namespace
}  // namespace rigcal::server::durability_test
