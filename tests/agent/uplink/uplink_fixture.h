// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "agent/spool/memory_spool.h"
#include "agent/uplink/uplink.h"
#include "tests/agent/uplink/fake_server.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent {

inline const StreamKey kLeft{"s-1", "left", 7};
inline const StreamKey kRight{"s-1", "right", 7};

inline UplinkOptions QuickOptions() {
  UplinkOptions options;
  options.servers = wire::ServerList::Of("fake");
  options.agent_id = "pc-1";
  options.incarnation = 7;
  options.stream_epoch = 7;
  options.host = "pc";
  options.rig = "hall";
  options.flush_interval = std::chrono::milliseconds(1);
  options.lowest_wait = std::chrono::milliseconds(1);
  options.highest_wait = std::chrono::milliseconds(20);
  options.refused_wait = std::chrono::milliseconds(5);
  return options;
}

// An agent with two cameras whose rows the test gives, against a server that the test directs.
class UplinkFixture : public ::testing::Test {
 protected:
  using State = FakeServer::State;

  void Start(UplinkOptions options = QuickOptions(),
             const std::string& left_timebase = "recording") {
    Start(std::move(options), left_timebase, [this](const std::string&, bool) { return server_.Channel(); });
  }
  void Start(UplinkOptions options, const std::string& left_timebase,
             Uplink::ChannelFactory make_channel) {
    auto left = std::make_unique<ScriptedSource>("left", left_timebase);
    auto right = std::make_unique<ScriptedSource>("right");
    left_ = left.get();
    right_ = right.get();
    std::vector<std::unique_ptr<ObservationSource>> sources;
    sources.push_back(std::move(left));
    sources.push_back(std::move(right));
    auto uplink =
        Uplink::Create(std::move(options), std::move(sources), &spool_, std::move(make_channel));
    ASSERT_THAT(uplink, ::rigcal::testing::IsOk());
    uplink_ = *std::move(uplink);
    uplink_->Start();
  }
  void TearDown() override {
    if (uplink_) uplink_->Shutdown(std::chrono::milliseconds(0));
    server_.Close();
  }

  // Every row from 1 to `count`, each with the time the source gave it.
  static void ExpectRows(const FakeServer::Stream& stream, uint32_t count) {
    ASSERT_THAT(stream.time_of_seq, ::testing::SizeIs(count));
    for (const auto& [seq, time_ns] : stream.time_of_seq) {
      ASSERT_EQ(time_ns, (int64_t{seq} - 1) * 1000) << seq;
    }
  }
  State WaitForEnd(const StreamKey& stream) {
    return server_.WaitFor([&](const State& now) { return now.HasEnded(stream); });
  }

  MemorySpool spool_;
  FakeServer server_;
  std::unique_ptr<Uplink> uplink_;
  ScriptedSource* left_ = nullptr;
  ScriptedSource* right_ = nullptr;
};

}  // namespace rigcal::agent
