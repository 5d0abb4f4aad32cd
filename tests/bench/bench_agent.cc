// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/bench_agent.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

#include "absl/strings/str_cat.h"
#include "common/wire/camera_wire.h"
#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "rigcal/v1/ingest_service.grpc.pb.h"

namespace rigcal::bench {
namespace {

using Clock = std::chrono::steady_clock;

double Seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

v1::ConnectRequest Hello(const LoadOptions& options, int agent) {
  v1::ConnectRequest message = BenchHello(agent);
  if (options.world != nullptr) {
    *message.mutable_hello()->mutable_cameras(0)->mutable_description() =
        wire::ToProto(options.world->cameras()[static_cast<size_t>(agent)].description);
  }
  return message;
}

// Rows from number `first_seq` on of a camera of the world.
v1::ConnectRequest WorldBatch(const LoadOptions& options, int agent, uint32_t first_seq) {
  ObservationBatch batch;
  const SimulatedCamera& camera = options.world->cameras()[static_cast<size_t>(agent)];
  batch.stream = {options.session_id, camera.description.camera, 1};
  batch.first_seq = first_seq;
  batch.marker_count = static_cast<uint32_t>(options.world->target().marker_count());
  for (int row = 0; row < options.rows_per_message; ++row) {
    batch.Append(options.world->Observe(agent, static_cast<int>(first_seq) - 1 + row));
  }
  v1::ConnectRequest message;
  wire::ToProto(batch, message.mutable_batch());
  return message;
}

// One agent: a writing and a reading thread over one stream.
class BenchAgent {
 public:
  BenchAgent(const LoadOptions& options, int agent) : options_(options), agent_(agent) {
    if (options.world == nullptr) {
      message_ = BenchBatch(agent, options.rows_per_message);
      message_.mutable_batch()->set_session_id(options.session_id);
    }
    grpc::ChannelArguments arguments;
    arguments.SetInt("grpc.use_local_subchannel_pool", 1);
    channel_ =
        grpc::CreateCustomChannel(options.address,
                                  options.credentials ? options.credentials(BenchAgentId(agent))
                                                      : grpc::InsecureChannelCredentials(),
                                  arguments);
    stub_ = v1::IngestService::NewStub(channel_);
    stream_ = stub_->Connect(&context_);
  }

  // Sends a hello and waits for the reply.
  bool Greet() {
    v1::ConnectResponse answer;
    return stream_->Write(Hello(options_, agent_)) && stream_->Read(&answer) && answer.has_hello();
  }

  void Run() {
    std::thread reader([this] { ReadAcks(); });
    WriteAll();
    reader.join();
    context_.TryCancel();
    (void)stream_->Finish();
  }

  bool complete() const { return acknowledged_ >= options_.rows_per_agent; }
  const std::vector<double>& ack_latency_s() const { return ack_latency_s_; }
  const std::vector<Acknowledged>& acknowledged() const { return acknowledged_messages_; }

 private:
  void WriteAll() {
    const Clock::time_point begin = Clock::now();
    for (uint32_t seq = 1; seq <= options_.rows_per_agent;
         seq += static_cast<uint32_t>(options_.rows_per_message)) {
      MakeMessage(seq);
      const uint32_t last = seq + static_cast<uint32_t>(options_.rows_per_message) - 1;
      if (options_.rows_per_s > 0) {
        std::this_thread::sleep_until(
            begin + std::chrono::duration_cast<Clock::duration>(
                        std::chrono::duration<double>(last / options_.rows_per_s)));
      }
      {
        std::unique_lock lock(mutex_);
        room_.wait(lock, [&] { return last <= acknowledged_ + options_.window || broken_; });
        if (broken_) return;
        sent_.push_back({last, Clock::now()});
      }
      if (!Write(message_)) return;
    }
  }

  void MakeMessage(uint32_t seq) {
    if (options_.world != nullptr) {
      message_ = WorldBatch(options_, agent_, seq);
      return;
    }
    v1::ObservationBatch* batch = message_.mutable_batch();
    batch->set_first_seq(seq);
    for (int row = 0; row < options_.rows_per_message; ++row) {
      batch->set_time_ns(row, (int64_t{seq} + row) * 1'000'000);
    }
  }

  // Both threads write: rows, and previews.
  bool Write(const v1::ConnectRequest& message) {
    const std::lock_guard lock(write_mutex_);
    return stream_->Write(message);
  }

  void AnswerPreview(const v1::PreviewRequest& request) {
    v1::ConnectRequest message;
    v1::Preview* preview = message.mutable_preview();
    preview->set_request_id(request.request_id());
    preview->set_status(v1::PREVIEW_STATUS_OK);
    preview->set_jpeg(options_.preview_jpeg);
    v1::PreviewInfo* info = preview->mutable_info();
    info->set_camera(request.camera());
    info->set_jpeg_bytes(static_cast<uint32_t>(options_.preview_jpeg.size()));
    info->set_outcome(v1::DETECTION_OUTCOME_WAND);
    for (v1::ImageSize* size : {info->mutable_image_size_px(), info->mutable_jpeg_size_px()}) {
      size->set_width(1280);
      size->set_height(1024);
    }
    Write(message);
  }

  void ReadAcks() {
    v1::ConnectResponse message;
    size_t next = 0;
    while (!complete() && stream_->Read(&message)) {
      if (message.has_preview_request() && !options_.preview_jpeg.empty()) {
        AnswerPreview(message.preview_request());
      }
      if (!message.has_ack()) continue;
      const Clock::time_point now = Clock::now();
      std::lock_guard lock(mutex_);
      acknowledged_ = message.ack().durable_seq();
      for (; next < sent_.size() && sent_[next].last_seq <= acknowledged_; ++next) {
        ack_latency_s_.push_back(Seconds(now - sent_[next].time));
        acknowledged_messages_.push_back({sent_[next].last_seq, now});
      }
      room_.notify_one();
    }
    std::lock_guard lock(mutex_);
    broken_ = !complete();
    room_.notify_one();
  }

  struct Sent {
    uint32_t last_seq;
    Clock::time_point time;
  };

  const LoadOptions options_;
  const int agent_;
  v1::ConnectRequest message_;
  grpc::ClientContext context_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::IngestService::Stub> stub_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::ConnectRequest, v1::ConnectResponse>> stream_;
  std::mutex mutex_;
  std::condition_variable room_;
  std::vector<Sent> sent_;
  std::vector<double> ack_latency_s_;
  std::vector<Acknowledged> acknowledged_messages_;
  std::mutex write_mutex_;
  std::atomic<uint32_t> acknowledged_ = 0;
  bool broken_ = false;
};

}  // namespace

v1::ConnectRequest BenchHello(int agent) {
  v1::ConnectRequest message;
  v1::AgentHello* hello = message.mutable_hello();
  *hello->mutable_protocol_version() = wire::OwnProtocolVersion();
  hello->set_agent_id(BenchAgentId(agent));
  hello->set_incarnation(1);
  hello->set_connection(1);
  hello->set_host("bench");
  hello->set_rig("rig");
  v1::AnnouncedCamera* camera = hello->add_cameras();
  camera->set_stream_epoch(1);
  v1::CameraDescription* description = camera->mutable_description();
  description->set_camera(BenchCameraName(agent));
  description->mutable_image_size_px()->set_width(1280);
  description->mutable_image_size_px()->set_height(1024);
  description->mutable_clock()->set_clock_id(BenchCameraName(agent));
  description->mutable_clock()->set_timebase("bench");
  return message;
}

v1::ConnectRequest BenchBatch(int agent, int rows) {
  v1::ConnectRequest message;
  v1::ObservationBatch* batch = message.mutable_batch();
  batch->set_camera(BenchCameraName(agent));
  batch->set_stream_epoch(1);
  batch->set_marker_count(3);
  for (int row = 0; row < rows; ++row) {
    batch->add_time_ns(0);
    batch->add_visible_mask(7);
    for (int marker = 0; marker < 3; ++marker) {
      batch->add_x_px(100.25f + static_cast<float>(row + 30 * marker));
      batch->add_y_px(200.75f + static_cast<float>(row));
      batch->add_cov_xx_px2(0.09f);
      batch->add_cov_xy_px2(0.0f);
      batch->add_cov_yy_px2(0.09f);
      batch->add_label_confidence(0.9f);
    }
  }
  batch->add_centre_kind(v1::CENTRE_KIND_SPHERE_CENTRE);
  return message;
}

std::string BenchAgentId(int agent) { return absl::StrCat("bench-agent-", agent); }
std::string BenchCameraName(int agent) { return absl::StrCat("bench_", agent); }

absl::StatusOr<LoadResult> RunLoad(const LoadOptions& options,
                                   const std::function<absl::Status()>& start) {
  std::vector<std::unique_ptr<BenchAgent>> agents;
  for (int i = 0; i < options.agents; ++i) {
    agents.push_back(std::make_unique<BenchAgent>(options, i));
    if (!agents.back()->Greet()) return absl::UnavailableError("an agent was not greeted");
  }
  if (absl::Status status = start(); !status.ok()) return status;
  const Clock::time_point begin = Clock::now();
  std::vector<std::thread> threads;
  for (auto& agent : agents) threads.emplace_back([&agent] { agent->Run(); });
  for (std::thread& thread : threads) thread.join();
  LoadResult result;
  result.duration_s = Seconds(Clock::now() - begin);
  for (const auto& agent : agents) {
    if (!agent->complete()) return absl::UnavailableError("a stream broke");
    result.rows += options.rows_per_agent;
    result.acknowledged.push_back(agent->acknowledged());
    result.ack_latency_s.insert(result.ack_latency_s.end(), agent->ack_latency_s().begin(),
                                agent->ack_latency_s().end());
  }
  std::sort(result.ack_latency_s.begin(), result.ack_latency_s.end());
  return result;
}

}  // namespace rigcal::bench
