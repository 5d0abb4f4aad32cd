// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/ingest.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <limits>
#include <optional>
#include <utility>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"
#include "common/failpoint/failpoint.h"
#include "common/status/guarded.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::seconds kDiskFullCheckInterval{1};
// Less than this beyond the store's reserve counts as full.
constexpr uint64_t kDiskHasRoomBytes = 16u << 20;
// Faults listed in an acknowledgement; all are counted.
constexpr size_t kMaxListedFaults = 16;

// For messages.
std::string StreamName(const StreamKey& stream) {
  return absl::StrCat("session ", stream.session_id, ", camera ", stream.camera);
}

BatchAck MakeAck(const Delivery& delivery, const AppendOutcome& outcome, uint32_t send_window) {
  const uint64_t send_limit = uint64_t{outcome.durable_seq} + send_window;
  BatchAck ack;
  ack.stream = delivery.stream();
  ack.durable_seq = outcome.durable_seq;
  ack.send_limit_seq =
      static_cast<uint32_t>(std::min<uint64_t>(send_limit, std::numeric_limits<uint32_t>::max()));
  for (const RefusedRow& refused : delivery.refused_rows) {
    if (ack.faults.size() == kMaxListedFaults) break;
    ack.faults.push_back(
        {.seq = delivery.batch.first_seq + refused.row,
         .field = absl::StrCat(std::string(refused.field), "[", refused.value, "]"),
         .reason = refused.reason});
  }
  ack.fault_count = delivery.refused_rows.size();
  ack.complete = outcome.complete;
  ack.conflict_count = outcome.conflict_rows;
  return ack;
}

void AddUp(const AppendOutcome& outcome, AppendOutcome* total) {
  AppendOutcome sum = outcome;
  sum.stored_rows += total->stored_rows;
  sum.duplicate_rows += total->duplicate_rows;
  sum.refused_rows += total->refused_rows;
  sum.conflict_rows += total->conflict_rows;
  *total = sum;
}

// What others do on the writer's thread must not end it.
template <typename Body>
void Call(std::string_view what, const Body& body) {
  const absl::Status status = Guarded(what, body);
  if (status.ok()) return;
  spdlog::error(
      "ingest: {}; what was stored is durable: if this is repeated, look at the memory of this PC, "
      "and restart the server",
      std::string(status.message()));
}

}  // namespace

Ingest::Ingest(const IngestOptions& options, Store* store, FindStreamContext find_context,
               ProgressHook on_progress, DeliveryHook on_delivery)
    : options_(options),
      store_(store),
      find_context_(std::move(find_context)),
      on_progress_(std::move(on_progress)),
      on_delivery_(std::move(on_delivery)),
      queue_(options.queue_limit_bytes, options.group_limit_bytes) {}

Ingest::~Ingest() { Shutdown(); }

void Ingest::Start() {
  writer_ = std::thread([this] { RunWriter(); });
}

void Ingest::Shutdown() {
  queue_.Close();
  if (writer_.joinable()) return writer_.join();
  // A writer that never ran.
  while (std::optional<IngestQueue::Group> group = queue_.Take()) {
    for (const IngestCallback& done : group->done) {
      done(absl::UnavailableError("the server is shutting down; try again later"));
    }
    for (const auto& on_space : group->on_space) on_space();
    queue_.Finish(*std::move(group));
  }
}

absl::Status Ingest::Submit(Delivery& delivery, IngestCallback done,
                            std::function<void()> on_space) {
  RIGCAL_ASSIGN_OR_RETURN(const StreamContext context, find_context_(delivery.stream()));
  RIGCAL_RETURN_IF_ERROR(failed());
  const size_t bytes = delivery.Bytes();
  RIGCAL_RETURN_IF_ERROR(queue_.Reserve(bytes, on_space));
  auto refused_rows = ValidateBatch(context, delivery.batch);
  if (!refused_rows.ok()) {
    queue_.Release(bytes);
    return absl::Status(refused_rows.status().code(),
                        absl::StrCat(StreamName(delivery.stream()), ": ",
                                     std::string(refused_rows.status().message())));
  }
  delivery.refused_rows = *std::move(refused_rows);
  queue_.Push(std::move(delivery), std::move(done), bytes);
  return absl::OkStatus();
}

IngestStats Ingest::Stats() const {
  const std::lock_guard lock(mutex_);
  IngestStats stats = stats_;
  stats.queue_bytes = queue_.held_bytes();
  return stats;
}

absl::Status Ingest::failed() const {
  const std::lock_guard lock(mutex_);
  return failed_;
}

bool Ingest::disk_full() const {
  const std::lock_guard lock(mutex_);
  return disk_full_;
}

void Ingest::RunWriter() {
  while (true) {
    std::optional<std::chrono::milliseconds> timeout;
    if (disk_full()) timeout = kDiskFullCheckInterval;
    std::optional<IngestQueue::Group> group = queue_.Take(timeout);
    if (!group) return;
    for (const auto& on_space : group->on_space) Call("telling that there is room", on_space);
    if (group->deliveries.empty()) {
      Call("looking at the disk", [this] { ForgetDiskFullWhenThereIsRoom(); });
    } else {
      Write(*group);
    }
    queue_.Finish(*std::move(group));
  }
}

void Ingest::Write(const IngestQueue::Group& group) {
  Failpoint("before_commit");
  const absl::StatusOr<std::vector<AppendOutcome>> outcomes = Append(group);
  Failpoint("after_commit");
  Call("noting a commit", [&] { NoteResult(outcomes); });
  if (!outcomes.ok()) {
    for (const IngestCallback& done : group.done) {
      Call("answering a delivery", [&] { done(outcomes.status()); });
    }
    return;
  }
  Failpoint("before_ack");
  Answer(group, *outcomes);
  Failpoint("after_ack");
  if (on_progress_) Call("noting progress", [&] { ReportProgress(group, *outcomes); });
  if (on_delivery_) ReportDeliveries(group, *outcomes);
}

absl::StatusOr<std::vector<AppendOutcome>> Ingest::Append(const IngestQueue::Group& group) {
  RIGCAL_RETURN_IF_ERROR(failed());
  try {
    absl::StatusOr<std::vector<AppendOutcome>> outcomes = store_->Append(group.deliveries);
    if (outcomes.ok() && outcomes->size() != group.deliveries.size()) {
      return absl::InternalError("the store has not answered every delivery");
    }
    return outcomes;
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("storing observations: ", error.what()));
  }
}

void Ingest::NoteResult(const absl::StatusOr<std::vector<AppendOutcome>>& outcomes) {
  const std::lock_guard lock(mutex_);
  if (outcomes.ok()) {
    ++stats_.commit_count;
    for (const AppendOutcome& outcome : *outcomes) {
      stats_.stored_observation_count += outcome.stored_rows;
      stats_.duplicate_observation_count += outcome.duplicate_rows;
      stats_.refused_observation_count += outcome.refused_rows;
      stats_.conflict_observation_count += outcome.conflict_rows;
    }
    if (disk_full_) spdlog::info("ingest: the disk has room again");
    disk_full_ = false;
    stats_.problem.clear();
    return;
  }
  const absl::Status& status = outcomes.status();
  if (!failed_.ok()) return;
  if (absl::IsResourceExhausted(status)) {
    if (!disk_full_) spdlog::error("ingest: {}", std::string(status.message()));
    disk_full_ = true;
  } else if (absl::IsUnavailable(status)) {
    spdlog::warn("ingest: {}", std::string(status.message()));
  } else {
    // An error other than a full disk is most likely permanent, and trying a failed sync again is
    // how data gets lost.
    failed_ = absl::InternalError(
        absl::StrCat("observations are not stored any more: ", std::string(status.message())));
    spdlog::error("ingest: {}", std::string(failed_.message()));
    stats_.problem = std::string(failed_.message());
    return;
  }
  stats_.problem = std::string(status.message());
}

void Ingest::Answer(const IngestQueue::Group& group,
                    const std::vector<AppendOutcome>& outcomes) const {
  for (size_t i = 0; i < outcomes.size(); ++i) {
    const Delivery& delivery = group.deliveries[i];
    Call("acknowledging a delivery", [&] {
      if (outcomes[i].unknown) {
        group.done[i](absl::NotFoundError(
            absl::StrCat(StreamName(delivery.stream()), ": does not exist (any more)")));
      } else {
        group.done[i](MakeAck(delivery, outcomes[i], options_.send_window));
      }
    });
  }
}

void Ingest::ReportProgress(const IngestQueue::Group& group,
                            const std::vector<AppendOutcome>& outcomes) const {
  absl::flat_hash_map<StreamKey, AppendOutcome> by_stream;
  for (size_t i = 0; i < outcomes.size(); ++i) {
    if (!outcomes[i].unknown) AddUp(outcomes[i], &by_stream[group.deliveries[i].stream()]);
  }
  for (const auto& [stream, outcome] : by_stream) {
    Call("noting progress", [&, &on = stream, &now = outcome] { on_progress_(on, now); });
  }
}

void Ingest::ReportDeliveries(const IngestQueue::Group& group,
                              const std::vector<AppendOutcome>& outcomes) const {
  for (size_t i = 0; i < outcomes.size(); ++i) {
    if (outcomes[i].unknown) continue;
    Call("showing a delivery", [&] { on_delivery_(group.deliveries[i], outcomes[i]); });
  }
}

void Ingest::ForgetDiskFullWhenThereIsRoom() {
  if (!disk_full()) return;
  const StoreHealth health = store_->Health();
  if (health.room_bytes() < health.reserve_bytes + kDiskHasRoomBytes) return;
  const std::lock_guard lock(mutex_);
  spdlog::info("ingest: the disk has room again");
  disk_full_ = false;
  stats_.problem.clear();
}

}  // namespace rigcal::server
