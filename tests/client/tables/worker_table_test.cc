// SPDX-License-Identifier: Apache-2.0
#include "client/tables/worker_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::client::worker_table_test {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

v1::SolveWorker* AddWorker(const char* host, int64_t heard_s, v1::GetStatusResponse* status) {
  v1::SolveWorker* worker = status->add_workers();
  worker->set_host(host);
  worker->set_pid(311);
  worker->set_software_version("0.1.0");
  worker->set_is_alive(true);
  worker->mutable_heartbeat_time()->set_seconds(heard_s);
  return worker;
}

TEST(WorkerTable, HasALineForEachProcess) {
  v1::GetStatusResponse status;
  AddWorker("desk", 1'000, &status)->set_is_server(true);
  AddWorker("pc-2", 1'000, &status)->add_calibration_ids("c-000007");
  v1::SolveWorker* gone = AddWorker("pc-3", 940, &status);
  gone->set_is_alive(false);
  gone->add_calibration_ids("c-000008");
  const std::string text = FormatWorkerList(status, 1'000);
  EXPECT_THAT(text, ContainsRegex("rigcal-server +desk +0.1.0 +- "));
  EXPECT_THAT(text, ContainsRegex("rigcal-worker +pc-2 +0.1.0 +c-000007 .* now +311"));
  EXPECT_THAT(text, ContainsRegex("pc-3 +0.1.0 +gone, had c-000008 .* 60 s ago"));
}

TEST(WorkerTable, SaysThatNobodySolves) {
  EXPECT_THAT(FormatWorkerList({}, 1'000), AllOf(HasSubstr("nobody solves"), Not(HasSubstr("pc"))));
}

}  // namespace
}  // namespace rigcal::client::worker_table_test
