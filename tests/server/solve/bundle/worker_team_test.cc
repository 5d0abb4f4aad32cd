// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/worker_team.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace rigcal::server::worker_team_test {
namespace {

TEST(WorkerTeam, RunsEachTaskOnceInEveryRound) {
  for (const int threads : {1, 2, 5}) {
    WorkerTeam team(threads);
    EXPECT_EQ(team.thread_count(), threads);
    std::vector<int> runs(100, 0);
    for (int round = 0; round < 200; ++round) {
      team.Run(static_cast<int>(runs.size()),
               [&runs](int task) { ++runs[static_cast<size_t>(task)]; });
    }
    EXPECT_THAT(runs, ::testing::Each(200)) << threads;
  }
}

TEST(WorkerTeam, TakesNoTasksAndFewerThanThreads) {
  WorkerTeam team(4);
  int runs = 0;
  team.Run(0, [&runs](int) { ++runs; });
  team.Run(1, [&runs](int) { ++runs; });
  EXPECT_EQ(runs, 1);
}

}  // namespace
}  // namespace rigcal::server::worker_team_test
