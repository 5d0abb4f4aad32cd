// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "agent/spool/observation_spool.h"

namespace rigcal::agent {

// Decides what is sent next, over all streams of the spool: rows only within the server's credit,
// the end of a stream after its last row. After a reconnection each stream continues after the rows
// that are durable at the server. Knows no network; for one thread.
//
// A full batch leaves at once, however many are on their way. Fewer rows leave at once behind a
// pause, and else `flush_interval` after the stream's last batch, or later while the server keeps
// batches waiting: four times as long as it does, so that a stream's batch waits for the server for
// a fifth of the time at most. Batches grow by themselves while the server is busy, and its queue
// stays short. How long it keeps them waiting is the time until a batch is acknowledged, smoothed
// as in RFC 6298 (2.3), less the shortest on this connection (Brakmo and Peterson, TCP Vegas,
// 1995): over a slow link to an idle server that is nothing.
class DeliveryPlan {
 public:
  using Message = std::variant<ObservationBatch, EndOfCapture>;

  using Clock = std::chrono::steady_clock;

  // So long rows wait at most to become a full batch.
  static constexpr std::chrono::milliseconds kLongestWait{200};

  // `keeps_until_standby`: the spool forgets rows once the server's standby has them, not before.
  DeliveryPlan(ObservationSpool* spool, Clock::duration flush_interval,
               bool keeps_until_standby = false)
      : spool_(spool), flush_interval_(flush_interval), keeps_until_standby_(keeps_until_standby) {}

  // A connection was made: nothing is in flight, and no stream has a position yet.
  void BeginConnection(size_t max_batch_rows);

  // The server's position of a stream. Within one connection positions only grow. A stream that has
  // been delivered completely repeats its end, in case the server asks because it missed it.
  void SetPosition(const StreamKey& stream, uint32_t durable_seq, uint32_t send_limit_seq);

  // Frees durable rows. True: more are durable than before. Acknowledgements of unknown streams
  // change nothing.
  bool Acknowledge(const BatchAck& ack, Clock::time_point now);

  // The next message; none: nothing to send, no credit for it, or not enough of it yet.
  std::optional<Message> Next(Clock::time_point now);
  // When to call Next again for rows that only time lets go, as of its last call; no such rows: the
  // end of time.
  Clock::time_point next_due() const { return next_due_; }
  // The server has given a position for this stream, and it is not delivered.
  bool IsDelivering(const StreamKey& stream) const { return progress_.contains(stream); }
  // There are streams on this connection that are not delivered.
  bool HasOpenStreams() const { return !progress_.empty(); }

  // The stream is in the spool, or was delivered or abandoned by this process.
  bool Knows(const StreamKey& stream) const {
    return over_.contains(stream) || spool_->Find(stream).has_value();
  }
  // This agent, or its run before, has ended a capture of the camera for the session, in another
  // stream than `stream`.
  bool HasEndedBefore(const StreamKey& stream) const;
  // Drops a stream that the server does not accept; returns how many observations are lost.
  uint32_t Discard(const StreamKey& stream);
  // Nothing is in the spool.
  bool IsDelivered() const { return spool_->Streams().empty(); }

  // Sent with the rows of each stream, once per connection.
  void AddAlignment(const HostAlignment& alignment);
  // Observations of these cameras wait for the first alignment of a connection, because the server
  // cannot relate their clocks to others without one; StopWaitingForAlignment ends that.
  void RequireAlignment(const std::string& camera) { aligned_cameras_.insert(camera); }
  void StopWaitingForAlignment() { waits_for_alignment_ = false; }

  // The server rejected a message as malformed. The first time, messages are sent one at a time
  // from then on, until all is delivered, so that the faulty one is found. Its stream is then
  // abandoned instead of being sent forever: rows that the server does not have are lost, the
  // stream ends there, and its report says why. Returns the abandoned stream.
  struct GivenUp {
    StreamKey stream;
    uint32_t lost_count = 0;
  };
  std::optional<GivenUp> OnProtocolFault(const std::string& message);
  // A message sent on this connection may be the faulty one.
  bool SuspectsFault() const { return one_at_a_time_ ? in_flight_.has_value() : sent_any_; }
  bool SendsOneAtATime() const { return one_at_a_time_; }

 private:
  struct Progress {
    uint32_t durable_seq = 0;
    uint32_t send_limit_seq = 0;
    uint32_t next_seq = 1;
    bool end_sent = false;
    size_t alignments_sent = 0;
    Clock::time_point last_sent;
    uint32_t timed_seq = 0;  // the last row of the batch whose round trip is measured; 0: none is
    Clock::time_point timed_since;
  };
  // From sending a batch until it is acknowledged, on this connection.
  struct RoundTrip {
    bool known = false;
    Clock::duration smoothed{0};
    Clock::duration shortest{0};

    void Add(Clock::duration measured);
  };
  struct InFlight {
    StreamKey stream;
    uint32_t last_seq = 0;
    bool is_end = false;
  };

  std::optional<Message> NextOf(const StreamKey& key, Progress& progress, Clock::time_point now);
  std::optional<Message> NextRows(const SpooledStream& spooled, Progress& progress,
                                  Clock::time_point now);
  bool Advance(const BatchAck& ack);
  // When less than a full batch may leave.
  Clock::time_point DueTime(const Progress& progress, Clock::time_point now) const;
  void NoteInFlight(const StreamKey& stream, uint32_t last_seq, bool is_end);
  void Remember(const StreamKey& stream, std::optional<EndOfCapture> end);

  ObservationSpool* const spool_;
  const Clock::duration flush_interval_;
  const bool keeps_until_standby_;
  size_t max_batch_rows_ = 1;
  std::map<StreamKey, Progress> progress_;  // streams the server has given a position for
  StreamKey last_sent_;                     // streams take turns
  RoundTrip round_trip_;
  Clock::time_point next_due_ = Clock::time_point::max();
  // Finished streams, with the end to repeat when asked; none: the server rejects the end too.
  std::map<StreamKey, std::optional<EndOfCapture>> over_;
  std::vector<StreamKey> over_in_order_;
  std::vector<EndOfCapture> ends_to_repeat_;
  std::vector<ObservationBatch> gaps_to_tell_;  // of streams that are not here any more
  std::vector<HostAlignment> alignments_;
  std::set<std::string> aligned_cameras_;
  bool waits_for_alignment_ = true;
  bool sent_any_ = false;  // on this connection
  bool one_at_a_time_ = false;
  std::optional<InFlight> in_flight_;  // kept only while one_at_a_time_
};

}  // namespace rigcal::agent
