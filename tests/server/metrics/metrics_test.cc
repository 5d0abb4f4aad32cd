// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "tests/server/rpc/rpc_fixture.h"

namespace rigcal::testing::metrics_test {
namespace {

using ::testing::HasSubstr;

class Metrics : public RpcFixture {
 protected:
  std::string Text() {
    return server::MetricsText({.store = faulty_.get(),
                                .ingest = ingest_.get(),
                                .directory = directory_of_agents_.get(),
                                .coordinator = coordinator_.get(),
                                .runner = runner_.get(),
                                .solves = &solves_,
                                .grpc =
                                    [] {
                                      return server::PortCounts{3, 7, 2};
                                    },
                                .web =
                                    [] {
                                      return server::WebCounts{{1, 4, 0}, 50, 6};
                                    },
                                .software_version = "0.1.0"});
  }

  server::SolveTimes solves_;
};

TEST_F(Metrics, ShowWhatTheServerDoes) {
  StartWave({"left", "right"});
  solves_.Add(3, true);
  solves_.Add(30, false);
  const std::string text = Text();
  for (const char* line :
       {"rigcal_sessions 1\n", "rigcal_sessions_capturing 1\n", "rigcal_calibrations_queued 0\n",
        "rigcal_sessions_draining 0\n", "rigcal_ingest_observations_total{result=\"stored\"} 0\n",
        "rigcal_ingest_up 1\n", "rigcal_solve_seconds_bucket{le=\"2\"} 0\n",
        "rigcal_solve_seconds_bucket{le=\"5\"} 1\n", "rigcal_solve_seconds_bucket{le=\"+Inf\"} 2\n",
        "rigcal_solve_seconds_sum 33\n", "rigcal_solves_failed_total 1\n",
        "rigcal_connections_open{port=\"grpc\"} 3\n",
        "rigcal_connections_accepted_total{port=\"http\"} 4\n", "rigcal_http_requests_total 50\n",
        "rigcal_info{version=\"0.1.0\"} 1\n"}) {
    EXPECT_THAT(text, HasSubstr(line));
  }
  EXPECT_THAT(text, HasSubstr("process_resident_memory_bytes "));
  EXPECT_THAT(text, HasSubstr("rigcal_store_disk_free_bytes "));
}

TEST_F(Metrics, AreWhatPrometheusReads) {
  std::istringstream lines(Text());
  const std::regex help(R"(# HELP ([a-z_]+) .+\.)");
  const std::regex type(R"(# TYPE ([a-z_]+) (counter|gauge|histogram))");
  const std::regex sample(R"(([a-z_]+)(\{[a-z_]+="[^"\n]*"(,[a-z_]+="[^"\n]*")*\})? \S+)");
  std::set<std::string> families;
  std::string family;
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, match, help)) {
      family = match[1];
      EXPECT_TRUE(families.insert(family).second) << family << " comes twice";
    } else if (!std::regex_match(line, type)) {
      ASSERT_TRUE(std::regex_match(line, match, sample)) << line;
      EXPECT_EQ(std::string(match[1]).find(family), 0u) << line;
    }
  }
  EXPECT_GT(families.size(), 20u);
}

}  // namespace
}  // namespace rigcal::testing::metrics_test
