// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "common/wire/camera_wire.h"
#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::session_service_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class SessionService : public RpcFixture {
 protected:
  void SetUp() override {
    RpcFixture::SetUp();
    stub_ = v1::SessionService::NewStub(channel());
  }
  static void SetDeadline(grpc::ClientContext* context) {
    context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  }
  absl::StatusOr<v1::ListSessionsResponse> List(uint32_t page_size, const std::string& token,
                                                const std::string& rig = "") {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::ListSessionsRequest request;
    request.set_page_size(page_size);
    request.set_page_token(token);
    if (!rig.empty()) request.set_filter("rig=" + rig);
    v1::ListSessionsResponse response;
    const absl::Status status = wire::FromGrpc(stub_->ListSessions(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }
  absl::Status Delete(const std::string& id) {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::DeleteSessionRequest request;
    request.set_id(id);
    v1::DeleteSessionResponse response;
    return wire::FromGrpc(stub_->DeleteSession(&context, request, &response));
  }
  // What ReadObservations gives, as (camera, first_seq, rows).
  absl::StatusOr<std::vector<std::tuple<std::string, uint32_t, int>>> ReadRuns(
      const v1::ReadObservationsRequest& request) {
    grpc::ClientContext context;
    SetDeadline(&context);
    const auto reader = stub_->ReadObservations(&context, request);
    std::vector<std::tuple<std::string, uint32_t, int>> runs;
    v1::ReadObservationsResponse response;
    while (reader->Read(&response)) {
      const v1::ObservationBatch& batch = response.batch();
      runs.emplace_back(batch.camera(), batch.first_seq(), batch.time_ns_size());
    }
    const absl::Status status = wire::FromGrpc(reader->Finish());
    if (!status.ok()) return status;
    return runs;
  }

  std::unique_ptr<v1::SessionService::Stub> stub_;
};

TEST_F(SessionService, RefusesWhatIsWrongWithARequest) {
  v1::CreateSessionRequest request = WaveRequest("a b");
  EXPECT_THAT(client().CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("id")));
  request = WaveRequest("wave");
  request.clear_target();
  EXPECT_THAT(client().CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("target")));
  request = WaveRequest("wave");
  request.mutable_target()->set_marker_positions_m(1, std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(client().CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("target")));
  request = WaveRequest("wave");
  request.add_cameras()->set_camera("left");
  EXPECT_THAT(client().CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("left")));
  request = WaveRequest("wave");
  request.mutable_target()->set_kind(v1::Target::KIND_POINT);
  request.mutable_target()->clear_marker_positions_m();
  request.mutable_target()->add_marker_positions_m(0);
  request.mutable_target()->add_marker_positions_m(0.1);
  EXPECT_THAT(client().CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("point")));
}

TEST_F(SessionService, NamesSessionsThatDoNotExist) {
  EXPECT_THAT(client().StartSession("nobody"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(client().StopSession("nobody", 0),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(client().GetSession("nobody"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(client().WaitUntilFinished("nobody"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(Delete("nobody"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  v1::ReadObservationsRequest request;
  request.set_session_id("nobody");
  EXPECT_THAT(ReadRuns(request), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

TEST_F(SessionService, DeletingACapturingSessionIsRefused) {
  StartWave({"left"});
  EXPECT_THAT(Delete("wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("capturing")));
  ASSERT_THAT(client().StopSession("wave", 0.01), IsOk());
  const v1::Session finished = AwaitState("wave", v1::Session::STATE_FINISHED);
  EXPECT_THAT(finished.missing_cameras(), ElementsAre("left"));
  EXPECT_THAT(Delete("wave"), IsOk());
  EXPECT_THAT(client().GetSession("wave"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("wave")));
}

TEST_F(SessionService, ListsPageByPageNewestFirst) {
  std::vector<std::string> created;
  for (int i = 0; i < 5; ++i) {
    ASSERT_OK_AND_ASSIGN(const v1::Session session, client().CreateSession(WaveRequest("")));
    created.push_back(session.id());
  }
  v1::CreateSessionRequest elsewhere = WaveRequest("");
  elsewhere.set_rig("other");
  ASSERT_THAT(client().CreateSession(elsewhere), IsOk());

  std::vector<std::string> listed;
  std::string token;
  int pages = 0;
  do {
    ASSERT_OK_AND_ASSIGN(const v1::ListSessionsResponse page, List(2, token, "rig"));
    for (const v1::Session& session : page.sessions()) listed.push_back(session.id());
    EXPECT_LE(page.sessions_size(), 2);
    token = page.next_page_token();
    ASSERT_LE(++pages, 3);
  } while (!token.empty());
  EXPECT_EQ(pages, 3);
  EXPECT_EQ(listed, std::vector<std::string>(created.rbegin(), created.rend()));

  // A page that is exactly full is the last one when there is nothing behind it.
  ASSERT_OK_AND_ASSIGN(const v1::ListSessionsResponse whole, List(5, "", "rig"));
  EXPECT_EQ(whole.sessions_size(), 5);
  EXPECT_EQ(whole.next_page_token(), "");
  ASSERT_OK_AND_ASSIGN(const v1::ListSessionsResponse every_rig, List(0, ""));
  EXPECT_EQ(every_rig.sessions_size(), 6);
  EXPECT_THAT(List(2, "garbage"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("page_token")));
}

TEST_F(SessionService, PagingGoesOnAfterTheTokensSessionWasDeleted) {
  std::vector<std::string> created;
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const v1::Session session, client().CreateSession(WaveRequest("")));
    created.push_back(session.id());
  }
  ASSERT_OK_AND_ASSIGN(const v1::ListSessionsResponse first, List(1, ""));
  ASSERT_THAT(Delete(first.sessions(0).id()), IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::ListSessionsResponse rest, List(5, first.next_page_token()));
  ASSERT_EQ(rest.sessions_size(), 2);
  EXPECT_EQ(rest.sessions(1).id(), created[0]);
}

TEST_F(SessionService, ListsByFilterAndOrder) {
  for (const char* id : {"b", "c", "a"}) {
    ASSERT_THAT(client().CreateSession(WaveRequest(id)), IsOk());
  }
  v1::CreateSessionRequest started = WaveRequest("d");
  *started.add_cameras() = wire::ToProto(MakeCamera("left"));
  ASSERT_THAT(client().CreateSession(started), IsOk());
  ASSERT_THAT(client().StartSession("d"), IsOk());
  const auto ids = [&](const std::string& filter, const std::string& order_by) {
    std::string joined;
    v1::ListSessionsRequest request;
    request.set_page_size(2);
    request.set_filter(filter);
    request.set_order_by(order_by);
    v1::ListSessionsResponse response;
    do {
      grpc::ClientContext context;
      SetDeadline(&context);
      request.set_page_token(response.next_page_token());
      response.Clear();
      const grpc::Status status = stub_->ListSessions(&context, request, &response);
      if (!status.ok()) return status.error_message();
      for (const v1::Session& session : response.sessions()) joined += session.id();
    } while (!response.next_page_token().empty());
    return joined;
  };
  EXPECT_EQ(ids("", ""), "dacb");
  EXPECT_EQ(ids("", "create_time"), "bcad");
  EXPECT_EQ(ids("", "id"), "abcd");
  EXPECT_EQ(ids("", "id desc"), "dcba");
  EXPECT_EQ(ids("state=STATE_CREATED AND rig=\"rig\"", "id"), "abc");
  EXPECT_EQ(ids("state=STATE_CAPTURING", ""), "d");
  EXPECT_EQ(ids("rig=elsewhere", ""), "");
  EXPECT_THAT(ids("state=CREATED", ""), HasSubstr("STATE_CREATED"));
  EXPECT_THAT(ids("title=x", ""), HasSubstr("'title' is not a field of this list"));
  EXPECT_THAT(ids("", "title"), HasSubstr("order_by"));
}

TEST_F(SessionService, ATokenIsForOneListOnly) {
  for (const char* id : {"a", "b"}) {
    ASSERT_THAT(client().CreateSession(WaveRequest(id)), IsOk());
  }
  ASSERT_OK_AND_ASSIGN(const v1::ListSessionsResponse first, List(1, ""));
  EXPECT_THAT(List(1, first.next_page_token(), "rig"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("page_token")));
}

TEST_F(SessionService, PagesStayBelowWhatAClientTakes) {
  // 40 sessions of 256 cameras each: far more than the 4 MiB of a client's default.
  v1::CreateSessionRequest request = WaveRequest("");
  for (int i = 0; i < 256; ++i) {
    *request.add_cameras() = wire::ToProto(MakeCamera("camera_" + std::to_string(i)));
  }
  for (v1::CameraDescription& camera : *request.mutable_cameras()) {
    camera.set_source(std::string(200, 'x'));
  }
  for (int i = 0; i < 40; ++i) ASSERT_THAT(client().CreateSession(request), IsOk());
  std::set<std::string> ids;
  std::string token;
  do {
    ASSERT_OK_AND_ASSIGN(const v1::ListSessionsResponse page, List(1000, token));
    for (const v1::Session& session : page.sessions()) ids.insert(session.id());
    token = page.next_page_token();
  } while (!token.empty() && ids.size() < 100);
  EXPECT_THAT(ids, SizeIs(40));
}

TEST_F(SessionService, WatchShowsEveryStateAndEndsWithFinished) {
  ASSERT_THAT(client().CreateSession(WaveRequest("wave")), IsOk());
  TestAgent agent(channel(), MakeHello("pc", {"left"}));
  agent.ReadHello();
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::WatchSessionRequest request;
  request.set_id("wave");
  const auto reader = stub_->WatchSession(&context, request);
  v1::WatchSessionResponse response;
  // Each state is reached after the one before has been seen.
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.session().state(), v1::Session::STATE_CREATED);
  ASSERT_THAT(client().StartSession("wave"), IsOk());
  while (response.session().state() == v1::Session::STATE_CREATED)
    ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.session().state(), v1::Session::STATE_CAPTURING);
  agent.SendBatch(MakeBatch({"wave", "left", 1}, 1, 10));
  while (response.session().observation_count() == 0) ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.session().observation_count(), 10u);
  EXPECT_TRUE(response.session().cameras(0).connected());
  ASSERT_THAT(client().StopSession("wave", 60), IsOk());
  while (response.session().state() == v1::Session::STATE_CAPTURING)
    ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.session().state(), v1::Session::STATE_DRAINING);
  agent.Send(EndMessage({"wave", "left", 1}, 10));
  while (response.session().state() == v1::Session::STATE_DRAINING)
    ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.session().state(), v1::Session::STATE_FINISHED);
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_THAT(wire::FromGrpc(reader->Finish()), IsOk());
}

TEST_F(SessionService, WatchOfADeletedSessionEnds) {
  ASSERT_THAT(client().CreateSession(WaveRequest("wave")), IsOk());
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::WatchSessionRequest request;
  request.set_id("wave");
  const auto reader = stub_->WatchSession(&context, request);
  v1::WatchSessionResponse response;
  ASSERT_TRUE(reader->Read(&response));
  ASSERT_THAT(Delete("wave"), IsOk());
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_THAT(wire::FromGrpc(reader->Finish()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("wave")));
}

TEST_F(SessionService, WatchesAreLimitedAndEndWithTheServer) {
  options_.max_watches = 1;
  RestartServerOnPort();
  stub_ = v1::SessionService::NewStub(channel());
  ASSERT_THAT(client().CreateSession(WaveRequest("wave")), IsOk());
  v1::WatchSessionRequest request;
  request.set_id("wave");
  grpc::ClientContext first_context;
  SetDeadline(&first_context);
  const auto first = stub_->WatchSession(&first_context, request);
  v1::WatchSessionResponse response;
  ASSERT_TRUE(first->Read(&response));
  grpc::ClientContext second_context;
  SetDeadline(&second_context);
  const auto second = stub_->WatchSession(&second_context, request);
  EXPECT_FALSE(second->Read(&response));
  EXPECT_THAT(wire::FromGrpc(second->Finish()),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("watching")));
  std::thread closer([this] { rpc_->Shutdown(std::chrono::seconds(5)); });
  EXPECT_FALSE(first->Read(&response));
  EXPECT_THAT(wire::FromGrpc(first->Finish()),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting down")));
  closer.join();
}

TEST_F(SessionService, WatchesHoldNoThreads) {
  options_.max_watches = 64;
  rpc_options_.endpoint.max_threads = 16;  // the fewest allowed
  RestartServerOnPort();
  stub_ = v1::SessionService::NewStub(channel());
  ASSERT_THAT(client().CreateSession(WaveRequest("wave")), IsOk());
  v1::WatchSessionRequest request;
  request.set_id("wave");
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::WatchSessionResponse>>> readers;
  v1::WatchSessionResponse response;
  for (int i = 0; i < 64; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    SetDeadline(contexts.back().get());
    readers.push_back(stub_->WatchSession(contexts.back().get(), request));
    ASSERT_TRUE(readers.back()->Read(&response));
  }
  EXPECT_THAT(client().GetSession("wave"), IsOk()) << "other calls are answered";
  ASSERT_THAT(Delete("wave"), IsOk());
  for (auto& reader : readers) {
    EXPECT_FALSE(reader->Read(&response));
    EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::NOT_FOUND);
  }
}

TEST_F(SessionService, WatchersThatLeaveMakeRoom) {
  options_.max_watches = 1;
  RestartServer();
  stub_ = v1::SessionService::NewStub(channel());
  ASSERT_THAT(client().CreateSession(WaveRequest("wave")), IsOk());
  v1::WatchSessionRequest request;
  request.set_id("wave");
  for (int i = 0; i < 3; ++i) {
    bool seen = false;
    // The server may notice a moment later that the one before has left.
    for (int attempt = 0; attempt < 1000 && !seen; ++attempt) {
      grpc::ClientContext context;
      SetDeadline(&context);
      const auto reader = stub_->WatchSession(&context, request);
      v1::WatchSessionResponse response;
      seen = reader->Read(&response);
      context.TryCancel();
      reader->Finish();
    }
    EXPECT_TRUE(seen) << i;
  }
}

TEST_F(SessionService, ReadsObservationsInTheirOrderWithoutRefusedAndLateOnes) {
  StartWave({"left", "right"});
  for (const char* camera : {"right", "left"}) {
    ObservationBatch batch = MakeBatch({"wave", camera, 1}, 1, 10);
    batch.visible_mask[4] = 7;
    for (size_t i = 12; i < 15; ++i) batch.centre_kind[i] = 1;
    batch.x_px[12] = std::numeric_limits<float>::infinity();
    ASSERT_THAT(client().Upload(batch), IsOk());
    ASSERT_THAT(client().UploadEnd("wave", camera, 1, 10), IsOk());
  }
  AwaitState("wave", v1::Session::STATE_FINISHED);
  ASSERT_THAT(client().Upload(MakeBatch({"wave", "left", 2}, 1, 3)), IsOk());

  v1::ReadObservationsRequest request;
  request.set_session_id("wave");
  ASSERT_OK_AND_ASSIGN(const auto runs, ReadRuns(request));
  int rows = 0;
  for (const auto& run : runs) rows += std::get<2>(run);
  EXPECT_EQ(rows, 18);
  EXPECT_EQ(std::get<0>(runs.front()), "left");
  EXPECT_EQ(std::get<0>(runs.back()), "right");
  for (const auto& [camera, first_seq, count] : runs) {
    EXPECT_FALSE(first_seq <= 5 && 5 < first_seq + static_cast<uint32_t>(count)) << "row 5";
  }
  request.set_camera("left");
  request.set_include_late(true);
  ASSERT_OK_AND_ASSIGN(const auto left, ReadRuns(request));
  rows = 0;
  for (const auto& run : left) rows += std::get<2>(run);
  EXPECT_EQ(rows, 12);
  request.set_camera("top");
  EXPECT_THAT(ReadRuns(request), StatusIs(absl::StatusCode::kNotFound, HasSubstr("top")));
}

}  // namespace
}  // namespace rigcal::testing::session_service_test
