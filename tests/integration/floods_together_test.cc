// SPDX-License-Identifier: Apache-2.0
// Every flood at once: silent sockets, streams without hello, readers that read nothing, and
// messages that would become hundreds of megabytes; meanwhile another client asks for the status.
#include <gmock/gmock.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/wire/camera_wire.h"
#include "common/wire/grpc_status.h"
#include "rigcal/v1/status_service.grpc.pb.h"
#include "tests/testing/process.h"
#include "tests/testing/process_figures.h"
#include "tests/testing/raw_socket.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::floods_together_test {
namespace {

using std::chrono::seconds;
using ::testing::AnyOf;
using ::testing::Eq;
using Clock = std::chrono::steady_clock;

constexpr int kSockets = 1100;
constexpr int kSilentStreams = 600;
constexpr int kReaders = 200;
constexpr int kCopies = 40;                      // of each large message
constexpr size_t kLargeBytes = (4 << 20) - 256;  // what the server takes as a message at most
constexpr uint32_t kRows = 60'000;               // far more than a connection takes unread
constexpr double kMaxServerMb = 512;

std::shared_ptr<grpc::Channel> ConnectionOfItsOwn(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

// Before sockets take all the places.
std::shared_ptr<grpc::Channel> Connected(const std::string& address) {
  const auto channel = ConnectionOfItsOwn(address);
  EXPECT_TRUE(channel->WaitForConnected(std::chrono::system_clock::now() + seconds(20)));
  return channel;
}

absl::Status GetStatus(const std::shared_ptr<grpc::Channel>& channel, seconds limit) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + limit);
  v1::GetStatusResponse response;
  return wire::FromGrpc(v1::StatusService::NewStub(channel)->GetStatus(&context, {}, &response));
}

// `inner` with copies of elements behind it, up to the largest size, as field 1 or 2 of an
// UploadBatchRequest (batch or end_of_capture).
std::string Large(uint32_t field, std::string inner, const std::function<std::string(int)>& more) {
  for (int i = 0; inner.size() < kLargeBytes; ++i) inner += more(i);
  std::string message;
  google::protobuf::io::StringOutputStream stream(&message);
  google::protobuf::io::CodedOutputStream out(&stream);
  out.WriteTag(field << 3 | 2);
  out.WriteVarint32(static_cast<uint32_t>(inner.size()));
  out.WriteString(inner);
  out.Trim();
  return message;
}

// An element of a repeated field that holds messages.
std::string Element(int field, const std::string& body) {
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream out(&stream);
  out.WriteTag(static_cast<uint32_t>(field) << 3 | 2);
  out.WriteVarint32(static_cast<uint32_t>(body.size()));
  out.WriteString(body);
  out.Trim();
  return bytes;
}

v1::ObservationBatch OneRow() {
  v1::ObservationBatch batch;
  batch.set_session_id("wave");
  batch.set_camera("left");
  batch.set_stream_epoch(1);
  batch.set_first_seq(kRows + 1);
  return batch;
}

// What 4 MiB can hold of each field that once had no limit.
std::map<std::string, std::string> LargeMessages() {
  using Batch = v1::ObservationBatch;
  const std::string row = OneRow().SerializeAsString();
  v1::EndOfCapture end;
  end.set_session_id("wave");
  end.set_camera("left");
  end.set_stream_epoch(1);
  end.set_last_seq(kRows);
  std::string reasons;
  for (int i = 0; reasons.size() < kLargeBytes - 100; ++i) {
    v1::RefusalCount count;
    count.set_camera("left");
    count.set_reason(static_cast<v1::RefusalReason>(1000 + i));
    count.set_count(1);
    count.set_example("line " + std::to_string(i));
    reasons += Element(v1::CameraReport::kRefusedFieldNumber, count.SerializeAsString());
  }
  return {
      {"clock samples",
       Large(1, row, [](int) { return Element(Batch::kClockSamplesFieldNumber, ""); })},
      {"alignments",
       Large(1, row, [](int) { return Element(Batch::kHostAlignmentsFieldNumber, ""); })},
      {"drop ranges", Large(1, row,
                            [](int i) {
                              v1::DroppedRange range;
                              range.set_first_seq(kRows + 2 + 2 * static_cast<uint32_t>(i));
                              range.set_count(1);
                              range.set_reason(v1::REFUSAL_REASON_SPOOL_FULL);
                              return Element(Batch::kDroppedFieldNumber, range.SerializeAsString());
                            })},
      {"reasons",
       Large(2, end.SerializeAsString() + Element(v1::EndOfCapture::kReportFieldNumber, reasons),
             [](int) { return std::string(64, '\0').insert(0, "\x7a\x40"); })}};
}

// Sends copies of a message at once, over a connection of its own, without a thread for each.
class LargeCalls {
 public:
  explicit LargeCalls(const std::string& address) : stub_(Connected(address)) {}
  ~LargeCalls() { Await(); }

  void Send(const std::string& message) {
    const grpc::Slice slice(message);
    for (int i = 0; i < kCopies; ++i) {
      calls_.push_back(std::make_unique<Call>());
      Call* const call = calls_.back().get();
      call->request = grpc::ByteBuffer(&slice, 1);
      call->context.set_deadline(std::chrono::system_clock::now() + seconds(60));
      stub_.UnaryCall(&call->context, "/rigcal.v1.IngestService/UploadBatch", grpc::StubOptions(),
                      &call->request, &call->response, [this](grpc::Status status) {
                        std::lock_guard lock(mutex_);
                        ++codes_[status.error_code()];
                        ++ended_;
                        changed_.notify_all();
                      });
    }
  }
  // How many ended with which code.
  std::map<grpc::StatusCode, int> Await() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_ == calls_.size(); });
    return codes_;
  }

 private:
  struct Call {
    grpc::ClientContext context;
    grpc::ByteBuffer request;
    grpc::ByteBuffer response;
  };
  grpc::GenericStub stub_;
  std::vector<std::unique_ptr<Call>> calls_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<grpc::StatusCode, int> codes_;
  size_t ended_ = 0;
};

// A stream that is opened and left alone.
template <typename Stream>
struct OpenStream {
  grpc::ClientContext context;
  std::unique_ptr<Stream> stream;

  OpenStream() { context.set_deadline(std::chrono::system_clock::now() + seconds(120)); }
  ~OpenStream() {
    context.TryCancel();
    stream->Finish();
  }
};
using AgentStreamUnderTest =
    OpenStream<grpc::ClientReaderWriter<v1::ConnectRequest, v1::ConnectResponse>>;
using ReaderUnderTest = OpenStream<grpc::ClientReader<v1::ReadObservationsResponse>>;

// Asks for the status again and again, and notes how long each answer took.
class StatusClient {
 public:
  explicit StatusClient(const std::string& address)
      : channel_(Connected(address)), thread_([this] { Run(); }) {}
  ~StatusClient() { Stop(); }

  // Seconds of each call, sorted.
  std::vector<double> Stop() {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
    std::sort(seconds_.begin(), seconds_.end());
    return seconds_;
  }
  int failures() const { return failures_; }

 private:
  void Run() {
    while (!stopping_) {
      const auto start = Clock::now();
      failures_ += !GetStatus(channel_, seconds(20)).ok();
      seconds_.push_back(std::chrono::duration<double>(Clock::now() - start).count());
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  const std::shared_ptr<grpc::Channel> channel_;
  std::atomic<bool> stopping_ = false;
  std::atomic<int> failures_ = 0;
  std::vector<double> seconds_;
  std::thread thread_;
};

class FloodsTogether : public ::testing::Test {
 protected:
  void SetUp() override {
    rlimit limit{};
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    if (limit.rlim_max < 2 * kSockets) {
      GTEST_SKIP() << "this process may open " << limit.rlim_max << " descriptors only";
    }
    const auto port_file = directory_.path() / "port";
    server_ = std::make_unique<Process>(Process::Options{
        {"/bin/sh", "-c",
         "ulimit -n 1024 && exec " RIGCAL_BIN_DIR
         "/rigcal-server --listen 127.0.0.1:0 --data-dir " +
             (directory_.path() / "store").string() + " --port-file " + port_file.string()},
        {}});
    ASSERT_TRUE(WaitFor([&] { return std::ifstream(port_file) >> port_ && port_ > 0; }))
        << server_->StandardError();
    address_ = "127.0.0.1:" + std::to_string(port_);
    ASSERT_NO_FATAL_FAILURE(Store());
  }

  // A session with observations to read.
  void Store() {
    ServerClient client(address_);
    v1::CreateSessionRequest request;
    request.set_id("wave");
    request.mutable_target()->set_kind(v1::Target::KIND_WAND);
    for (const double position : {0.0, 0.13, 0.39}) {
      request.mutable_target()->add_marker_positions_m(position);
    }
    CameraDescription camera;
    camera.camera = "left";
    camera.image_size_px = {.width = 1280, .height = 1024};
    camera.clock = {.clock_id = "left", .timebase = "recording"};
    *request.add_cameras() = wire::ToProto(camera);
    ASSERT_THAT(client.CreateSession(request), IsOk());
    ASSERT_THAT(client.StartSession("wave"), IsOk());
    for (uint32_t first = 1; first < kRows; first += 6000) {
      ObservationBatch batch;
      batch.stream = {"wave", "left", 1};
      batch.first_seq = first;
      batch.marker_count = 3;
      for (uint32_t seq = first; seq < first + 6000; ++seq) {
        Observation row;
        row.time_ns = int64_t{seq} * 1'000'000;
        row.markers.resize(3);
        for (MarkerObservation& marker : row.markers) {
          marker.visible = true;
          marker.centre_px = {100.0 + seq % 900, 50};
        }
        batch.Append(row);
      }
      ASSERT_THAT(client.Upload(batch), IsOk());
    }
  }

  std::vector<RawSocket> OpenSockets() const {
    std::vector<RawSocket> sockets;
    for (int i = 0; i < kSockets; ++i) {
      sockets.emplace_back(port_, "127.0.0." + std::to_string(2 + i % 100));
      if (i % 2 == 0) sockets.back().Send("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n");
    }
    return sockets;
  }
  std::vector<std::unique_ptr<AgentStreamUnderTest>> OpenSilentStreams() const {
    std::vector<std::unique_ptr<AgentStreamUnderTest>> streams;
    std::unique_ptr<v1::IngestService::Stub> stub;
    for (int i = 0; i < kSilentStreams; ++i) {
      if (i % 100 == 0) stub = v1::IngestService::NewStub(Connected(address_));
      streams.push_back(std::make_unique<AgentStreamUnderTest>());
      streams.back()->stream = stub->Connect(&streams.back()->context);
    }
    return streams;
  }
  std::vector<std::unique_ptr<ReaderUnderTest>> OpenReaders() const {
    std::vector<std::unique_ptr<ReaderUnderTest>> readers;
    std::unique_ptr<v1::SessionService::Stub> stub;
    v1::ReadObservationsRequest request;
    request.set_session_id("wave");
    for (int i = 0; i < kReaders; ++i) {
      if (i % 50 == 0) stub = v1::SessionService::NewStub(Connected(address_));
      readers.push_back(std::make_unique<ReaderUnderTest>());
      readers.back()->stream = stub->ReadObservations(&readers.back()->context, request);
    }
    return readers;
  }

  TemporaryDirectory directory_;
  std::unique_ptr<Process> server_;
  int port_ = 0;
  std::string address_;
};

TEST_F(FloodsTogether, LeaveAnotherClientServedAndTheServerSmall) {
  ASSERT_THAT(ServerClient(address_).ListAgents(), IsOk());
  const double before_mb = PeakMemoryMb(server_->pid());
  const std::map<std::string, std::string> messages = LargeMessages();
  StatusClient status(address_);
  {
    std::vector<std::pair<std::string, std::unique_ptr<LargeCalls>>> calls;
    for (const auto& [name, message] : messages) {
      calls.emplace_back(name, std::make_unique<LargeCalls>(address_));
    }
    const auto silent = OpenSilentStreams();
    const auto readers = OpenReaders();
    const auto sockets = OpenSockets();
    for (const auto& [name, call] : calls) call->Send(messages.at(name));
    for (const auto& [name, call] : calls) {
      for (const auto& [code, count] : call->Await()) {
        std::printf("%d messages of 4 MiB of %s end with code %d\n", count, name.c_str(), code);
        // Refused; or so many are under way at once that their connection is cut as a flood.
        EXPECT_THAT(code, AnyOf(Eq(grpc::StatusCode::INVALID_ARGUMENT),
                                Eq(grpc::StatusCode::RESOURCE_EXHAUSTED),
                                Eq(grpc::StatusCode::UNAVAILABLE)))
            << name;
      }
    }
    // The rest of them is held open for a while longer.
    std::this_thread::sleep_for(seconds(3));
  }
  const auto healed = Clock::now();
  EXPECT_TRUE(WaitFor([&] { return GetStatus(ConnectionOfItsOwn(address_), seconds(2)).ok(); },
                      seconds(10)))
      << server_->StandardError();
  const double again_s = std::chrono::duration<double>(Clock::now() - healed).count();
  const std::vector<double> took_s = status.Stop();
  EXPECT_EQ(status.failures(), 0);
  ASSERT_GT(took_s.size(), 20u);
  const double p99_s = took_s[took_s.size() * 99 / 100];
  const double peak_mb = PeakMemoryMb(server_->pid());
  std::printf(
      "GetStatus: %zu calls, median %.1f ms, p99 %.1f ms, longest %.1f ms; server: peak %.0f MB "
      "(%.0f MB before); new connections after %.2f s\n",
      took_s.size(), 1e3 * took_s[took_s.size() / 2], 1e3 * p99_s, 1e3 * took_s.back(), peak_mb,
      before_mb, again_s);
  EXPECT_LT(p99_s, 1);
  if (!kMemoryIsSanitized) {
    EXPECT_LT(peak_mb, kMaxServerMb);
  }

  // Nothing of it has been stored, and lists can be read.
  ServerClient client(address_);
  const auto session = client.GetSession("wave");
  ASSERT_THAT(session, IsOk());
  EXPECT_EQ(session->observation_count(), kRows);
  EXPECT_EQ(session->state(), v1::Session::STATE_CAPTURING);
  EXPECT_EQ(RunCommand({"rigcal", "session", "list", "--server", address_}).exit_code, 0);
  server_->Signal(SIGTERM);
  EXPECT_EQ(server_->Wait(), 0);
}

}  // namespace
}  // namespace rigcal::testing::floods_together_test
