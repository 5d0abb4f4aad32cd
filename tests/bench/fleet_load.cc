// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/fleet_load.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "agent/spool/delivery_plan.h"
#include "agent/spool/memory_spool.h"
#include "agent/uplink/conversation.h"
#include "agent/uplink/uplink.h"
#include "agent/uplink/uplink_connection.h"
#include "common/status/status_macros.h"
#include "common/wire/agent_wire.h"
#include "common/wire/observation_wire.h"
#include "tests/bench/bench_agent.h"
#include "tests/testing/process_figures.h"

namespace rigcal::bench::fleet_load {
namespace {

using Clock = std::chrono::steady_clock;
using Agents = std::set<size_t>;

constexpr std::chrono::seconds kPatience{120};  // without anything from the server
// The one thread wakes for rows so often at most: 25 000 times a second it would use the CPU time
// of a server, and a row that is late is counted as such.
constexpr std::chrono::milliseconds kRowsTogether{1};

double Seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }
Clock::duration Duration(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

// Agents whose connection has something to tell.
class Events {
 public:
  void Add(size_t agent) {
    const std::lock_guard lock(mutex_);
    if (agents_.empty()) changed_.notify_one();
    agents_.insert(agent);
  }
  // Waits for one until then.
  Agents TakeUntil(Clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, deadline, [this] { return !agents_.empty(); });
    return std::exchange(agents_, {});
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  Agents agents_;
};

class FleetAgent {
 public:
  FleetAgent(const FleetOptions& options, size_t index, Events* events)
      : camera_(BenchCameraName(static_cast<int>(index))),
        connection_(agent::Uplink::MakeChannel(options.address),
                    [events, index] { events->Add(index); }) {
    row_.markers.resize(3);
    for (MarkerObservation& marker : row_.markers) {
      marker.visible = true;
      marker.centre_px = {640.25, 480.5};
    }
    connection_.Write(BenchHello(static_cast<int>(index)));
  }

  bool greeted() const { return greeted_; }
  bool captures() const { return stream_.has_value(); }
  bool delivered() const { return captures() && spool_.Streams().empty(); }
  Clock::time_point next_due() const { return plan_.next_due(); }
  uint32_t row_count() const { return static_cast<uint32_t>(row_due_.size()); }

  // A row that should be there since `due`.
  absl::Status AddRow(Clock::time_point due, bool is_last) {
    row_.time_ns += 1'000'000;
    row_due_.push_back(due);
    RIGCAL_RETURN_IF_ERROR(spool_.Append(*stream_, row_, {}).status());
    return is_last ? spool_.Finish(*stream_, {}) : absl::OkStatus();
  }

  // Takes what the server has sent, and sends what may leave now.
  absl::Status Serve(FleetResult* result) {
    for (const v1::ConnectResponse& message : connection_.TakeMessages()) {
      RIGCAL_RETURN_IF_ERROR(Handle(message, result));
    }
    if (const auto ended = connection_.Result()) {
      return absl::UnavailableError(absl::StrCat(camera_, ": ", ended->ToString()));
    }
    while (greeted_ && connection_.CanWrite()) {
      const Clock::time_point now = Clock::now();
      std::optional<agent::DeliveryPlan::Message> next = plan_.Next(now);
      if (!next) break;
      v1::ConnectRequest message;
      if (const auto* batch = std::get_if<ObservationBatch>(&*next)) {
        sent_.push_back({batch->end_seq() - 1, now});
        ++result->messages;
        wire::ToProto(*batch, message.mutable_batch());
      } else {
        *message.mutable_end_of_capture() = wire::ToProto(std::get<EndOfCapture>(*next));
      }
      connection_.Write(std::move(message));
    }
    return absl::OkStatus();
  }

 private:
  struct Sent {
    uint32_t last_seq = 0;
    Clock::time_point time;
  };

  absl::Status Handle(const v1::ConnectResponse& message, FleetResult* result) {
    if (message.has_hello()) {
      greeted_ = true;
      plan_.BeginConnection(agent::UplinkOptions{}.max_batch_rows);
    } else if (message.has_start_capture()) {
      const v1::StreamPosition& position = message.start_capture().cameras(0);
      RIGCAL_ASSIGN_OR_RETURN(stream_, wire::FromProto(position.stream()));
      RIGCAL_RETURN_IF_ERROR(spool_.Open(*stream_, static_cast<int>(row_.markers.size()), 1));
      plan_.SetPosition(*stream_, position.durable_seq(), position.send_limit_seq());
    } else if (message.has_ack()) {
      RIGCAL_ASSIGN_OR_RETURN(const BatchAck ack, wire::FromProto(message.ack()));
      const Clock::time_point now = Clock::now();
      plan_.Acknowledge(ack, now);
      for (; acknowledged_ < ack.durable_seq && acknowledged_ < row_due_.size(); ++acknowledged_) {
        result->row_latency_s.push_back(Seconds(now - row_due_[acknowledged_]));
      }
      for (; !sent_.empty() && sent_.front().last_seq <= ack.durable_seq; sent_.pop_front()) {
        result->ack_latency_s.push_back(Seconds(now - sent_.front().time));
      }
    }
    return absl::OkStatus();
  }

  const std::string camera_;
  agent::MemorySpool spool_;
  agent::DeliveryPlan plan_{&spool_, agent::UplinkOptions{}.flush_interval};
  agent::UplinkConnection connection_;
  Observation row_;
  bool greeted_ = false;
  std::optional<StreamKey> stream_;
  std::vector<Clock::time_point> row_due_;
  uint32_t acknowledged_ = 0;
  std::deque<Sent> sent_;
};

class Fleet {
 public:
  explicit Fleet(const FleetOptions& options) : options_(options) {
    for (size_t i = 0; i < static_cast<size_t>(options.agents); ++i) {
      agents_.push_back(std::make_unique<FleetAgent>(options, i, &events_));
    }
  }

  // Serves them until `reached` is so for all.
  absl::Status WaitUntilAll(bool (FleetAgent::*reached)() const) {
    Clock::time_point give_up = Clock::now() + kPatience;
    while (!std::ranges::all_of(agents_, [&](const auto& one) { return (*one.*reached)(); })) {
      const Agents told = events_.TakeUntil(give_up);
      if (told.empty()) return absl::DeadlineExceededError("the server says nothing any more");
      give_up = Clock::now() + kPatience;
      for (const size_t agent : told) RIGCAL_RETURN_IF_ERROR(agents_[agent]->Serve(&result_));
    }
    return absl::OkStatus();
  }

  absl::Status Capture() {
    const double cpu_before_s = testing::CpuSeconds(getpid());
    begin_ = Clock::now() + Duration(1 / options_.rows_per_s);
    uint32_t row = 0;  // of each agent
    size_t agent = 0;  // whose row is the next one
    Clock::time_point next_rows = begin_;
    while (row < options_.rows_per_agent) {
      Agents active =
          events_.TakeUntil(std::min(std::max(DueTime(agent, row), next_rows), WakeTime()));
      const Clock::time_point now = Clock::now();
      next_rows = now + kRowsTogether;
      for (; row < options_.rows_per_agent && DueTime(agent, row) <= now;) {
        RIGCAL_RETURN_IF_ERROR(
            agents_[agent]->AddRow(DueTime(agent, row), row + 1 == options_.rows_per_agent));
        active.insert(agent);
        if (++agent < agents_.size()) continue;
        agent = 0;
        ++row;
      }
      while (!timers_.empty() && timers_.begin()->first <= now) {
        active.insert(timers_.begin()->second);
        timers_.erase(timers_.begin());
      }
      for (const size_t one : active) {
        RIGCAL_RETURN_IF_ERROR(agents_[one]->Serve(&result_));
        if (agents_[one]->next_due() != Clock::time_point::max()) {
          timers_.insert({agents_[one]->next_due(), one});
        }
      }
    }
    RIGCAL_RETURN_IF_ERROR(WaitUntilAll(&FleetAgent::delivered));
    result_.duration_s = Seconds(Clock::now() - begin_);
    result_.client_cpu_s = testing::CpuSeconds(getpid()) - cpu_before_s;
    return absl::OkStatus();
  }

  FleetResult TakeResult() {
    for (const auto& agent : agents_) result_.rows += agent->row_count();
    std::ranges::sort(result_.row_latency_s);
    std::ranges::sort(result_.ack_latency_s);
    return std::move(result_);
  }

 private:
  Clock::time_point DueTime(size_t agent, uint32_t row) const {
    const double turn =
        options_.in_turn ? static_cast<double>(agent) / static_cast<double>(agents_.size()) : 0;
    return begin_ + Duration((row + turn) / options_.rows_per_s);
  }
  Clock::time_point WakeTime() const {
    return timers_.empty() ? Clock::time_point::max() : timers_.begin()->first;
  }

  const FleetOptions options_;
  Events events_;
  std::vector<std::unique_ptr<FleetAgent>> agents_;  // go before the events that they tell
  std::set<std::pair<Clock::time_point, size_t>> timers_;
  Clock::time_point begin_;
  FleetResult result_;
};

}  // namespace
}  // namespace rigcal::bench::fleet_load

namespace rigcal::bench {

absl::StatusOr<FleetResult> RunFleet(const FleetOptions& options,
                                     const std::function<absl::Status()>& start) {
  using fleet_load::Fleet;
  using fleet_load::FleetAgent;
  Fleet fleet(options);
  RIGCAL_RETURN_IF_ERROR(fleet.WaitUntilAll(&FleetAgent::greeted));
  RIGCAL_RETURN_IF_ERROR(start());
  RIGCAL_RETURN_IF_ERROR(fleet.WaitUntilAll(&FleetAgent::captures));
  RIGCAL_RETURN_IF_ERROR(fleet.Capture());
  return fleet.TakeResult();
}

}  // namespace rigcal::bench
