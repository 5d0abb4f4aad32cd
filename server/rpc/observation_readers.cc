// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/observation_readers.h"

#include <grpc/grpc.h>
#include <grpcpp/server_context.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <deque>
#include <exception>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "common/wire/request_traits.h"

namespace rigcal::server {
namespace {

constexpr size_t kMessageBytes = size_t{1} << 20;
// On the wire, at most: time and mask of a row; all columns of a marker; a sample or alignment.
constexpr size_t kRowBytes = 16, kMarkerBytes = 40;
constexpr size_t kReadingsPerMessage = 8192;

absl::Status ServerEnding() {
  return absl::UnavailableError("the server is shutting down; read again after a moment");
}

class RefusedReader final : public ObservationReaders::Reactor {
 public:
  explicit RefusedReader(const absl::Status& reason) { Finish(wire::ToGrpc(reason)); }
  void OnDone() override { delete this; }
};

// Takes up to `count` from the front.
template <typename T>
std::vector<T> TakeFront(size_t count, std::vector<T>* from) {
  const auto end = from->begin() + static_cast<std::ptrdiff_t>(std::min(count, from->size()));
  std::vector<T> taken(from->begin(), end);
  from->erase(from->begin(), end);
  return taken;
}

}  // namespace

std::vector<ObservationBatch> CutToMessages(ObservationBatch batch) {
  const size_t rows_per_message =
      std::max<size_t>(1, kMessageBytes / (kRowBytes + kMarkerBytes * batch.marker_count));
  std::vector<ObservationBatch> messages;
  auto samples = std::exchange(batch.clock_samples, {});
  auto alignments = std::exchange(batch.host_alignments, {});
  const bool fits = batch.rows() <= rows_per_message;
  for (size_t begin = 0; begin < batch.rows() && !fits; begin += rows_per_message) {
    messages.push_back(batch.Slice(begin, std::min(begin + rows_per_message, batch.rows())));
  }
  if (fits) messages.push_back(std::move(batch));
  for (size_t m = 0; !samples.empty() || !alignments.empty(); ++m) {
    if (m == messages.size()) messages.push_back(messages.front().Slice(0, 0));
    messages[m].clock_samples = TakeFront(kReadingsPerMessage, &samples);
    messages[m].host_alignments = TakeFront(kReadingsPerMessage, &alignments);
  }
  return messages;
}

// One client. Its steps run on the thread of the readers; gRPC calls the reactions.
class ObservationReaders::Stream final : public Reactor,
                                         public std::enable_shared_from_this<Stream> {
 public:
  Stream(ObservationReaders* readers, grpc::CallbackServerContext* context,
         const v1::ReadObservationsRequest& request)
      : readers_(*readers), context_(context), request_(request) {}

  void Begin() {
    self_ = shared_from_this();
    Post();
    WatchForStall();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok) {
      End(absl::CancelledError("the client has disconnected"));
    } else if (end_) {
      End(*end_);
    } else {
      Post();
    }
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    if (!writing_) End(absl::CancelledError("the client has disconnected"));
  }

  void OnDone() override {
    std::shared_ptr<Stream> self;
    {
      const std::lock_guard lock(mutex_);
      done_ = true;
      self = std::move(self_);
    }
    readers_.Remove(self);
  }

  // Ends the stream with `status`, at once even where the client takes nothing: what waits for it
  // is thrown away.
  void Cut(const absl::Status& status) {
    const std::lock_guard lock(mutex_);
    if (done_ || finished_ || end_) return;
    if (!writing_) return End(status);
    end_ = status;
    const std::string message(status.message());
    grpc_call_cancel_with_status(context_->c_call(), static_cast<grpc_status_code>(status.code()),
                                 message.c_str(), nullptr);
  }

 private:
  void Post() {
    readers_.tasks_.Post([self = shared_from_this()] { self->Step(); });
  }

  void WatchForStall() {
    const auto look = std::chrono::steady_clock::now() + readers_.options_.stall_limit / 4;
    readers_.tasks_.PostAt(look, [weak = weak_from_this()] {
      const std::shared_ptr<Stream> stream = weak.lock();
      if (stream) stream->CheckForStall();
    });
  }

  void CheckForStall() {
    bool stalled = false;
    {
      const std::lock_guard lock(mutex_);
      if (done_) return;
      stalled = writing_ &&
                std::chrono::steady_clock::now() - write_start_ > readers_.options_.stall_limit;
    }
    if (stalled) {
      const double limit_s = std::chrono::duration<double>(readers_.options_.stall_limit).count();
      spdlog::info("a reader of session {} took nothing for {} s and is cut off",
                   request_.session_id(), limit_s);
      Cut(absl::DeadlineExceededError(absl::StrCat("the client took no observations of session '",
                                                   request_.session_id(), "' for ", limit_s,
                                                   " s; read again, and faster")));
    }
    WatchForStall();
  }

  // Reads and writes the next message.
  void Step() {
    {
      const std::lock_guard lock(mutex_);
      if (finished_ || done_ || writing_) return;
    }
    absl::StatusOr<bool> more = false;
    try {
      more = ReadNext();
    } catch (const std::exception& error) {
      more = absl::InternalError(absl::StrCat("an unexpected fault: ", error.what()));
    }
    if (absl::IsInternal(more.status()) || absl::IsDataLoss(more.status())) {
      spdlog::error("ReadObservations: {}", std::string(more.status().message()));
    }
    const std::lock_guard lock(mutex_);
    if (finished_ || done_) return;
    if (context_->IsCancelled()) return End(absl::CancelledError("the client has disconnected"));
    if (!more.ok() || !*more) return End(more.status());
    writing_ = true;
    write_start_ = std::chrono::steady_clock::now();
    StartWrite(&response_);
  }

  // Into response_. False: that was all.
  absl::StatusOr<bool> ReadNext() {
    if (!cursor_) RIGCAL_RETURN_IF_ERROR(OpenCursor());
    while (waiting_.empty()) {
      RIGCAL_ASSIGN_OR_RETURN(std::optional<StoredBatch> stored, cursor_->Next());
      if (!stored) return false;
      if (stored->late && !request_.include_late()) continue;
      for (ObservationBatch& batch : AcceptedRows(*std::move(stored))) {
        for (ObservationBatch& message : CutToMessages(std::move(batch))) {
          waiting_.push_back(std::move(message));
        }
      }
    }
    wire::ToProto(waiting_.front(), response_.mutable_batch());
    waiting_.pop_front();
    return true;
  }

  absl::Status OpenCursor() {
    const std::string& id = request_.session_id();
    RIGCAL_ASSIGN_OR_RETURN(hold_, readers_.coordinator_.HoldSessions({id}));
    RIGCAL_ASSIGN_OR_RETURN(const Session session, readers_.store_.GetSession(id));
    if (!request_.camera().empty() && session.FindCamera(request_.camera()) == nullptr) {
      return absl::NotFoundError(
          absl::StrCat("session '", id, "' has no camera '", request_.camera(), "'"));
    }
    RIGCAL_ASSIGN_OR_RETURN(cursor_, readers_.store_.OpenObservations(id, request_.camera()));
    return absl::OkStatus();
  }

  // With mutex_ held.
  void End(const absl::Status& status) {
    if (std::exchange(finished_, true)) return;
    Finish(wire::ToGrpc(status));
  }

  ObservationReaders& readers_;
  grpc::CallbackServerContext* const context_;
  const v1::ReadObservationsRequest request_;
  std::shared_ptr<Stream> self_;  // until OnDone

  // Of the steps, one of which runs at a time.
  SessionHold hold_;
  std::unique_ptr<ObservationCursor> cursor_;
  std::deque<ObservationBatch> waiting_;
  v1::ReadObservationsResponse response_;

  std::mutex mutex_;
  bool writing_ = false;
  bool finished_ = false;
  bool done_ = false;
  std::optional<absl::Status> end_;  // once what is being written is gone
  std::chrono::steady_clock::time_point write_start_;
};

ObservationReaders::ObservationReaders(ObservationReaderOptions options, const Store* store,
                                       SessionCoordinator* coordinator)
    : options_(options), store_(*store), coordinator_(*coordinator) {
  tasks_.Start();
}

ObservationReaders::~ObservationReaders() { tasks_.Shutdown(); }

ObservationReaders::Reactor* ObservationReaders::Open(grpc::CallbackServerContext* context,
                                                      const v1::ReadObservationsRequest& request) {
  if (const absl::Status fault = wire::FaultOf(request); !fault.ok()) {
    return new RefusedReader(fault);
  }
  const auto stream = std::make_shared<Stream>(this, context, request);
  if (absl::Status status = Add(stream); !status.ok()) return new RefusedReader(status);
  stream->Begin();
  return stream.get();
}

absl::Status ObservationReaders::Add(const std::shared_ptr<Stream>& stream) {
  const std::lock_guard lock(mutex_);
  if (ending_) return ServerEnding();
  if (streams_.size() >= options_.max_readers) {
    return absl::ResourceExhaustedError(
        absl::StrCat(options_.max_readers,
                     " clients read observations, which is the limit; try again later, or raise "
                     "limits.max_readers on the server"));
  }
  streams_.insert(stream);
  return absl::OkStatus();
}

void ObservationReaders::Remove(const std::shared_ptr<Stream>& stream) {
  const std::lock_guard lock(mutex_);
  streams_.erase(stream);
}

void ObservationReaders::EndStreams() {
  std::set<std::shared_ptr<Stream>> streams;
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    streams = streams_;
  }
  for (const auto& stream : streams) stream->Cut(ServerEnding());
}

size_t ObservationReaders::count() const {
  const std::lock_guard lock(mutex_);
  return streams_.size();
}

}  // namespace rigcal::server
