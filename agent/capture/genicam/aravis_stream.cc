// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_stream.h"

#include <spdlog/spdlog.h>

#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Buffers of all frames together; more would be a slip of the pen.
constexpr uint64_t kMostBufferBytes = uint64_t{4} << 30;
// When a camera has stopped, what it sent has come when nothing came for this long.
constexpr std::chrono::milliseconds kQuiet(60);
// Aravis gives an incomplete frame up after 100 ms.
constexpr std::chrono::milliseconds kGivenUp(400);
// A camera that does not stop sending is not waited for.
constexpr std::chrono::seconds kLongestEnd(1);
// Of IP, UDP and stream headers in each packet (GigE Vision 1).
constexpr uint64_t kPacketOverheadBytes = 36;

// The kernel cuts what is asked to this, without an error.
void WarnOfSmallSocketBuffer(const std::string& camera, int asked_bytes) {
  int64_t most_bytes = 0;
  std::ifstream file("/proc/sys/net/core/rmem_max");
  if (!(file >> most_bytes) || most_bytes >= asked_bytes) return;
  spdlog::warn(
      "camera {}: the kernel gives a socket at most {} bytes of buffer, not {}: under load frames "
      "will be damaged; run `sysctl -w net.core.rmem_max={}`, and put that into /etc/sysctl.d",
      camera, most_bytes, asked_bytes, asked_bytes);
}

}  // namespace

absl::StatusOr<std::unique_ptr<AravisStream>> AravisStream::Start(
    AravisCamera* camera, const AravisSourceOptions& options, CaptureBell* bell) {
  RIGCAL_ASSIGN_OR_RETURN(const uint32_t payload_bytes, camera->PayloadBytes());
  const auto buffer_count = static_cast<uint64_t>(options.buffer_count);
  if (buffer_count * payload_bytes > kMostBufferBytes) {
    return absl::InvalidArgumentError(absl::StrCat(options.buffer_count, " buffers of ",
                                                   payload_bytes,
                                                   " bytes are more than 4 GiB; ask for fewer"));
  }
  std::unique_ptr<AravisStream> stream(new AravisStream(camera, bell));
  GErrorSlot error;
  stream->stream_.reset(
      arv_camera_create_stream(camera->get(), &AravisStream::OnEvent, stream.get(), error.out()));
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot receive a stream"));
  if (!stream->stream_) {
    return absl::UnavailableError("cannot receive a stream");
  }
  if (ARV_IS_GV_STREAM(stream->stream_.get())) {
    // Aravis counts the packets of such frames, not the frames.
    const uint64_t packet_bytes = arv_camera_gv_get_packet_size(camera->get(), error.out());
    if (error.ok() && packet_bytes > kPacketOverheadBytes) {
      const uint64_t data_bytes = packet_bytes - kPacketOverheadBytes;
      stream->packets_per_frame_ = (payload_bytes + data_bytes - 1) / data_bytes + 2;
    }
    WarnOfSmallSocketBuffer(options.camera, options.socket_buffer_bytes);
    g_object_set(stream->stream_.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
                 "socket-buffer-size", options.socket_buffer_bytes, "packet-resend",
                 options.packet_resend ? ARV_GV_STREAM_PACKET_RESEND_ALWAYS
                                       : ARV_GV_STREAM_PACKET_RESEND_NEVER,
                 nullptr);
  }
  for (uint64_t i = 0; i < buffer_count; ++i) {
    ArvBuffer* const buffer = arv_buffer_new_allocate(payload_bytes);
    if (buffer == nullptr) {
      return absl::ResourceExhaustedError("no memory for its frames");
    }
    stream->GiveBack(buffer);
  }
  arv_camera_start_acquisition(camera->get(), error.out());
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot start it"));
  return stream;
}

void AravisStream::OnEvent(void* self, ArvStreamCallbackType type, ArvBuffer*) {
  auto* const stream = static_cast<AravisStream*>(self);
  if (type == ARV_STREAM_CALLBACK_TYPE_START_BUFFER) ++stream->begun_;
  if (type == ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) {
    ++stream->done_;
    stream->bell_->Ring();
  }
}

void AravisStream::GiveBack(ArvBuffer* buffer) {
  // Aravis leaves the number of an earlier frame in place when the packet with it is lost.
  arv_buffer_set_frame_id(buffer, 0);
  arv_stream_push_buffer(stream_.get(), buffer);
}

void AravisStream::StopCamera() {
  last_wait_ends_ = std::chrono::steady_clock::now() + kLongestEnd;
  if (camera_->control_lost()) return;
  GErrorSlot error;
  arv_camera_stop_acquisition(camera_->get(), error.out());
  if (!error.ok()) spdlog::debug("a camera could not be stopped: {}", error.message());
}

bool AravisStream::WaitForLast() {
  if (camera_->control_lost() || std::chrono::steady_clock::now() > last_wait_ends_) return false;
  // Packets that find no buffer ring no bell, and a busy machine is slow to take them in.
  const uint64_t before = packets_without_buffer();
  return bell_->Wait(done_ < begun_ ? kGivenUp : kQuiet) || packets_without_buffer() != before;
}

uint64_t AravisStream::packets_without_buffer() const {
  guint64 completed = 0;
  guint64 failures = 0;
  guint64 underruns = 0;
  arv_stream_get_statistics(stream_.get(), &completed, &failures, &underruns);
  return underruns;
}

}  // namespace rigcal::agent
