// SPDX-License-Identifier: Apache-2.0
#include "server/session/agent_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/session/recording_link.h"
#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::agent_directory_test {
namespace {

using server::AgentDirectory;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::shared_ptr<RecordingLink> Link() { return std::make_shared<RecordingLink>(); }

TEST(AgentDirectory, ListsWhoIsConnectedByRig) {
  AgentDirectory directory;
  ASSERT_THAT(directory.Register(MakeAgent("b", {"right"}), Link()), IsOk());
  ASSERT_THAT(directory.Register(MakeAgent("a", {"left", "middle"}), Link()), IsOk());
  AgentRecord elsewhere = MakeAgent("c", {"left"});
  elsewhere.rig = "other";
  ASSERT_THAT(directory.Register(elsewhere, Link()), IsOk());

  EXPECT_THAT(directory.ConnectedCameraNames("rig"), ElementsAre("left", "middle", "right"));
  EXPECT_THAT(directory.ConnectedCameraNames("other"), ElementsAre("left"));
  EXPECT_THAT(directory.List("rig"), SizeIs(2));
  EXPECT_THAT(directory.List(""), SizeIs(3));
  EXPECT_EQ(directory.ConnectedCount(), 3u);
}

TEST(AgentDirectory, KeepsWhatAnAgentLastSaidOfAStream) {
  server::AgentDirectoryOptions options;
  options.max_stream_reports = 2;
  AgentDirectory directory(options);
  const StreamKey left{"wave", "left", 1}, right{"wave", "right", 1}, top{"wave", "top", 1};
  EXPECT_FALSE(directory.StreamReport(left));
  directory.SetStreamReport(left, {.last_seq = 5, .spooled_count = 5});
  directory.SetStreamReport(left, {.last_seq = 9, .acknowledged_seq = 4, .spooled_count = 5});
  directory.SetStreamReport(right, {.last_seq = 2});
  ASSERT_TRUE(directory.StreamReport(left));
  EXPECT_EQ(directory.StreamReport(left)->last_seq, 9u);
  // Bounded; those that are known go on.
  directory.SetStreamReport(top, {.last_seq = 1});
  EXPECT_FALSE(directory.StreamReport(top));
  directory.SetStreamReport(right, {.last_seq = 3});
  EXPECT_EQ(directory.StreamReport(right)->last_seq, 3u);
  directory.ForgetStreamReport(left);
  EXPECT_FALSE(directory.StreamReport(left));
}

TEST(AgentDirectory, HigherConnectionFencesOffTheHalfDeadStream) {
  AgentDirectory directory;
  const auto old_link = Link();
  ASSERT_OK_AND_ASSIGN(const auto old_registration,
                       directory.Register(MakeAgent("pc", {"left"}, 3, 1), old_link));
  const auto new_link = Link();
  ASSERT_THAT(directory.Register(MakeAgent("pc", {"left"}, 3, 2), new_link), IsOk());

  EXPECT_THAT(old_link->closed(), StatusIs(absl::StatusCode::kAborted,
                                           AllOf(HasSubstr("incarnation 3, connection 1"),
                                                 HasSubstr("incarnation 3, connection 2"))));
  EXPECT_THAT(new_link->closed(), IsOk());
  // The end of the old stream must not unregister the new one.
  EXPECT_FALSE(directory.Unregister(old_registration));
  EXPECT_EQ(directory.ConnectedCount(), 1u);
  EXPECT_EQ(directory.List("")[0].connection, 2u);
}

TEST(AgentDirectory, HigherIncarnationFencesOffWhateverItsConnection) {
  AgentDirectory directory;
  const auto old_link = Link();
  ASSERT_THAT(directory.Register(MakeAgent("pc", {"left"}, 3, 9), old_link), IsOk());
  ASSERT_THAT(directory.Register(MakeAgent("pc", {"left"}, 4, 1), Link()), IsOk());
  EXPECT_THAT(old_link->closed(), StatusIs(absl::StatusCode::kAborted, HasSubstr("'pc'")));
}

TEST(AgentDirectory, LowerIsRefusedAndBothAreNamed) {
  AgentDirectory directory;
  const auto link = Link();
  ASSERT_THAT(directory.Register(MakeAgent("pc", {"left"}, 3, 5), link), IsOk());
  for (const auto& [incarnation, connection] :
       std::vector<std::pair<uint32_t, uint32_t>>{{3, 4}, {2, 9}}) {
    EXPECT_THAT(directory.Register(MakeAgent("pc", {"left"}, incarnation, connection), Link()),
                StatusIs(absl::StatusCode::kAborted,
                         AllOf(HasSubstr("incarnation 3, connection 5"),
                               HasSubstr("incarnation " + std::to_string(incarnation) +
                                         ", connection " + std::to_string(connection)))));
  }
  EXPECT_THAT(link->closed(), IsOk());
}

TEST(AgentDirectory, TwoProcessesWithOneIdAreBothNamed) {
  AgentDirectory directory;
  const auto link = Link();
  ASSERT_THAT(directory.Register(MakeAgent("pc", {"left"}), link), IsOk());
  AgentRecord copy = MakeAgent("pc", {"left"});
  copy.host = "laptop";
  EXPECT_THAT(directory.Register(copy, Link()),
              StatusIs(absl::StatusCode::kAlreadyExists,
                       AllOf(HasSubstr("'laptop'"), HasSubstr("'host-of-pc'"))));
  EXPECT_THAT(link->closed(), IsOk());
}

// Two PCs with copies of one state folder; the copy was started more often.
TEST(AgentDirectory, ACopyOfAnAgentDoesNotTakeItsPlace) {
  auto now = std::chrono::steady_clock::time_point(std::chrono::hours(1));
  AgentDirectory directory({.now = [&] { return now; }});
  const auto link = Link();
  AgentRecord first = MakeAgent("pc", {"left"}, 3, 7);
  first.address = "10.0.0.5";
  ASSERT_OK_AND_ASSIGN(const auto registration, directory.Register(first, link));
  AgentRecord on_another_host = MakeAgent("pc", {"left"}, 9, 1);
  on_another_host.host = "laptop";
  on_another_host.address = "10.0.0.5";
  AgentRecord at_another_address = MakeAgent("pc", {"left"}, 9, 1);
  at_another_address.address = "10.0.0.6";
  for (int minutes = 0; minutes < 3; ++minutes) {
    for (const AgentRecord& copy : {on_another_host, at_another_address}) {
      EXPECT_THAT(directory.Register(copy, Link()),
                  StatusIs(absl::StatusCode::kAlreadyExists,
                           AllOf(HasSubstr("incarnation 3, connection 7"),
                                 HasSubstr("incarnation 9, connection 1"), HasSubstr("10.0.0.5"),
                                 HasSubstr("'" + copy.host + "'"), HasSubstr("state folder"))));
    }
    EXPECT_THAT(link->closed(), IsOk());
    now += std::chrono::seconds(20);
    directory.SetSpool(registration, {});  // as it reports every 10 s
  }
  // The agent itself, restarted or with a new connection, where it is.
  first.incarnation = 4;
  EXPECT_THAT(directory.Register(first, Link()), IsOk());
  // It is silent: it may be the same PC with another address.
  now += std::chrono::seconds(25);
  EXPECT_THAT(directory.Register(at_another_address, Link()), IsOk());
}

TEST(AgentDirectory, CameraOfAnotherAgentIsRefusedAndAllAreNamed) {
  AgentDirectory directory;
  ASSERT_OK_AND_ASSIGN(const auto registration,
                       directory.Register(MakeAgent("first", {"left", "right"}), Link()));
  EXPECT_THAT(
      directory.Register(MakeAgent("second", {"top", "right"}), Link()),
      StatusIs(absl::StatusCode::kAlreadyExists,
               AllOf(HasSubstr("'first'"), HasSubstr("'second'"), HasSubstr("'rig/right'"))));
  // The refused one leaves nothing behind.
  EXPECT_THAT(directory.ConnectedCameraNames("rig"), ElementsAre("left", "right"));
  EXPECT_TRUE(directory.Unregister(registration));
  EXPECT_THAT(directory.Register(MakeAgent("second", {"top", "right"}), Link()), IsOk());
}

TEST(AgentDirectory, ComebackThatIsRefusedKeepsTheOldStream) {
  AgentDirectory directory;
  const auto link = Link();
  ASSERT_THAT(directory.Register(MakeAgent("first", {"left"}), link), IsOk());
  ASSERT_THAT(directory.Register(MakeAgent("second", {"right"}), Link()), IsOk());
  EXPECT_THAT(directory.Register(MakeAgent("first", {"left", "right"}, 1, 2), Link()),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("right")));
  EXPECT_THAT(link->closed(), IsOk());
  EXPECT_EQ(directory.ConnectedCount(), 2u);
}

TEST(AgentDirectory, RemembersTheLastOnesThatWent) {
  server::AgentDirectoryOptions options;
  options.max_remembered_agents = 2;
  options.utc_now_ns = [] { return int64_t{42}; };
  AgentDirectory directory(options);
  for (const std::string id : {"one", "two", "three"}) {
    ASSERT_OK_AND_ASSIGN(const auto registration,
                         directory.Register(MakeAgent(id, {"left"}), Link()));
    EXPECT_TRUE(directory.Unregister(registration));
    EXPECT_FALSE(directory.Unregister(registration));
  }
  const auto agents = directory.List("");
  ASSERT_THAT(agents, SizeIs(2));
  EXPECT_EQ(agents[0].agent_id, "three");
  EXPECT_EQ(agents[1].agent_id, "two");
  EXPECT_FALSE(agents[0].connected);
  EXPECT_EQ(agents[0].disconnect_utc_ns, 42);
  EXPECT_THAT(directory.ConnectedCameras("rig"), IsEmpty());
}

TEST(AgentDirectory, TakesNoMoreThanTheLimitButLetsThemComeBack) {
  server::AgentDirectoryOptions options;
  options.max_connected_agents = 1;
  options.max_cameras_per_agent = 2;
  AgentDirectory directory(options);
  ASSERT_THAT(directory.Register(MakeAgent("one", {"left"}), Link()), IsOk());
  EXPECT_THAT(directory.Register(MakeAgent("two", {"right"}), Link()),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("'two'")));
  EXPECT_THAT(directory.Register(MakeAgent("one", {"left"}, 1, 2), Link()), IsOk());
  EXPECT_THAT(directory.Register(MakeAgent("one", {"a", "b", "c"}, 1, 3), Link()),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("3 cameras")));
}

TEST(AgentDirectory, RefusesMalformedAnnouncements) {
  struct Case {
    std::function<void(AgentRecord*)> damage;
    std::string said;
  };
  const std::vector<Case> cases = {
      {[](AgentRecord* agent) { agent->cameras.push_back(agent->cameras[0]); }, "twice"},
  };
  AgentDirectory directory;
  for (const Case& bad : cases) {
    AgentRecord agent = MakeAgent("pc", {"left"});
    bad.damage(&agent);
    EXPECT_THAT(directory.Register(agent, Link()),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(bad.said)));
  }
  EXPECT_EQ(directory.ConnectedCount(), 0u);
}

TEST(AgentDirectory, FindsAnAgentWithoutACameraWhileItIsConnected) {
  AgentDirectory directory;
  EXPECT_FALSE(directory.FindAgent("pc").has_value());
  ASSERT_OK_AND_ASSIGN(const auto registration, directory.Register(MakeAgent("pc", {}), Link()));
  const auto found = directory.FindAgent("pc");
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->rig, "rig");
  EXPECT_EQ(found->registration, registration);
  EXPECT_TRUE(directory.ConnectedCameras("").empty());
  directory.Unregister(registration);
  EXPECT_FALSE(directory.FindAgent("pc").has_value());
}

TEST(AgentDirectory, CloseAllClosesEverybodyAndTakesNobodyIn) {
  AgentDirectory directory;
  const auto first = Link();
  const auto second = Link();
  ASSERT_THAT(directory.Register(MakeAgent("one", {"left"}), first), IsOk());
  ASSERT_THAT(directory.Register(MakeAgent("two", {"right"}), second), IsOk());
  directory.CloseAll(absl::UnavailableError("going"));
  EXPECT_THAT(first->closed(), StatusIs(absl::StatusCode::kUnavailable, "going"));
  EXPECT_THAT(second->closed(), StatusIs(absl::StatusCode::kUnavailable, "going"));
  EXPECT_THAT(directory.Register(MakeAgent("three", {"top"}), Link()),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting down")));
}

TEST(AgentDirectory, OfManyStreamsAtOnceOnlyTheNewestStays) {
  AgentDirectory directory;
  constexpr int kThreads = 4;
  constexpr int kPerThread = 50;
  std::vector<std::shared_ptr<RecordingLink>> links(kThreads * kPerThread);
  for (auto& link : links) link = Link();
  std::atomic<int> taken = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kPerThread; ++i) {
        const int n = i * kThreads + t;
        const auto registration = directory.Register(
            MakeAgent("pc", {"left"}, 1, static_cast<uint32_t>(n + 1)), links[n]);
        if (registration.ok()) ++taken;
        directory.ConnectedCameras("rig");
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  int closed = 0;
  for (const auto& link : links) closed += link->closed().ok() ? 0 : 1;
  EXPECT_EQ(closed, taken - 1);
  EXPECT_THAT(links.back()->closed(), IsOk());
  EXPECT_EQ(directory.ConnectedCount(), 1u);
  EXPECT_EQ(directory.List("")[0].connection, static_cast<uint32_t>(links.size()));
}

}  // namespace
}  // namespace rigcal::testing::agent_directory_test
