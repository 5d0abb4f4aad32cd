// SPDX-License-Identifier: Apache-2.0
// A peer that has joined floods the server over HTTP/2, in ways that gRPC 1.51 does not bound;
// meanwhile another client asks for the status. RIGCAL_FLOOD_SECONDS=60 makes each flood long.
#include "tests/testing/http2_flood.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "common/wire/grpc_status.h"
#include "rigcal/v1/status_service.grpc.pb.h"
#include "tests/testing/process.h"
#include "tests/testing/process_figures.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::http2_flood_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;

constexpr double kMaxServerMb = 512;

seconds FloodTime() {
  const char* const text = std::getenv("RIGCAL_FLOOD_SECONDS");
  return seconds(text == nullptr ? 6 : std::max(1, std::atoi(text)));
}

class Http2FloodTest : public ::testing::TestWithParam<Http2Attack> {
 protected:
  Http2FloodTest() { ca_.WriteServerFolder(store() / "identity", ca_.MakeServer()); }

  std::filesystem::path store() const { return directory_.path() / "store"; }
  std::string Audit() const {
    std::ifstream stream(store() / "audit.jsonl");
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::shared_ptr<grpc::Channel> ChannelOf(const TestCertificate& certificate,
                                           const std::string& address) const {
    const auto credentials = grpc::SslCredentials({.pem_root_certs = ca_.certificate_pem(),
                                                   .pem_private_key = certificate.key_pem,
                                                   .pem_cert_chain = certificate.certificate_pem});
    return grpc::CreateChannel(address, credentials);
  }

  TemporaryDirectory directory_;
  TestCa ca_;
};

// Seconds that each of the calls took, which come at a steady rate.
std::vector<double> AskForStatus(const std::shared_ptr<grpc::Channel>& channel, seconds duration) {
  const auto stub = v1::StatusService::NewStub(channel);
  std::vector<double> times;
  const auto end = Clock::now() + duration;
  while (Clock::now() < end) {
    const auto begin = Clock::now();
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + seconds(20));
    v1::GetStatusResponse response;
    EXPECT_THAT(wire::FromGrpc(stub->GetStatus(&context, {}, &response)), IsOk());
    times.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
    std::this_thread::sleep_until(begin + milliseconds(20));
  }
  std::ranges::sort(times);
  return times;
}

TEST_P(Http2FloodTest, IsCutAndNamedAndOthersDoNotNotice) {
  ServerProcess server(store());
  const auto other = ChannelOf(ca_.MakeUser("kim", "viewer"), server.address());
  AskForStatus(other, seconds(1));
  const double before_mb = MemoryMb(server.process().pid());
  std::vector<double> times;
  uint64_t bytes = 0;
  int connections = 0;
  {
    Http2Flood flood(
        {.port = server.port(), .attack = GetParam(), .certificate = ca_.MakeAgent("mallory")});
    times = AskForStatus(other, FloodTime());
    flood.Stop();
    bytes = flood.bytes_sent();
    connections = flood.connections();
  }
  const double peak_mb = PeakMemoryMb(server.process().pid());
  const double p99_s = times.at(times.size() * 99 / 100);
  std::printf(
      "%s: %.1f MB over %d connections in %lld s; memory %.0f MB before, %.0f at most, %.0f after; "
      "%zu calls of another client, p99 %.3f s, longest %.3f s\n",
      Name(GetParam()), static_cast<double>(bytes) / 1e6, connections,
      static_cast<long long>(FloodTime().count()), before_mb, peak_mb,
      MemoryMb(server.process().pid()), times.size(), p99_s, times.back());
  if (!kMemoryIsSanitized) {
    EXPECT_LT(peak_mb, kMaxServerMb);
  }
  // Generous limits, against waiting for the end of the flood.
  EXPECT_LT(p99_s, 2);
  // gRPC itself ends or slows down the others.
  if (GetParam() == Http2Attack::kRapidReset || GetParam() == Http2Attack::kEndlessContinuation ||
      GetParam() == Http2Attack::kEndlessHeader) {
    EXPECT_THAT(Audit(), ::testing::ContainsRegex("connection_cut.*mallory"));
    const CommandResult doctor =
        RunCommand({"rigcal", "doctor", "unix:" + (store() / "rigcal.sock").string()});
    EXPECT_THAT(doctor.output, ::testing::ContainsRegex("connections .*mallory"));
  }
  EXPECT_TRUE(server.process().Running());
  AskForStatus(other, seconds(1));
}

INSTANTIATE_TEST_SUITE_P(Attacks, Http2FloodTest,
                         ::testing::Values(Http2Attack::kRapidReset, Http2Attack::kHpackReferences,
                                           Http2Attack::kEndlessContinuation,
                                           Http2Attack::kEndlessHeader,
                                           Http2Attack::kUnreadAnswers),
                         [](const auto& attack) {
                           std::string name = Name(attack.param);
                           std::erase(name, ' ');
                           return name;
                         });

}  // namespace
}  // namespace rigcal::testing::http2_flood_test
