// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal {

// One event of a simulated sensor; its clock begins at 0 with the simulation.
struct SimulatedEvent {
  int64_t time_us = 0;
  uint16_t x = 0;
  uint16_t y = 0;
  bool on = false;

  friend bool operator==(const SimulatedEvent&, const SimulatedEvent&) = default;
};

// A pixel that asks to be read.
struct PixelRequest {
  double time_us = 0;
  uint16_t x = 0;
  uint16_t y = 0;
  bool on = false;
};

// The bus of a sensor: reads one row at a time, all that wait in it at once and with one time; the
// next row is the next one below that has something. One thread at a time.
class EventReadout {
 public:
  // Time of a row, and of each of its events besides.
  EventReadout(uint32_t height, double row_us, double event_us);

  // Takes requests, in any order, none before the end of the last call, and appends what was read
  // before `end_us`, in order of time, row by row from left to right. What waits is kept.
  void Read(std::vector<PixelRequest>* requests, double end_us,
            std::vector<SimulatedEvent>* events);

  size_t waiting() const { return waiting_; }
  // Events that did not fit: more than a million waited.
  uint64_t lost() const { return lost_; }

 private:
  static constexpr size_t kMaxWaiting = 1000000;
  void SortByTime(std::vector<PixelRequest>* requests);
  void Enter(const PixelRequest& request);
  void ReadRow(std::vector<SimulatedEvent>* events);

  double row_us_, event_us_;
  double free_at_us_ = 0;
  uint32_t next_row_ = 0;
  // Events waiting in each row: 2 * column, plus one if it is darker; so ON comes before OFF.
  std::vector<std::vector<uint32_t>> rows_;
  std::vector<uint64_t> row_waits_;  // a bit for each row
  size_t waiting_ = 0;
  uint64_t lost_ = 0;
  std::vector<PixelRequest> sorted_;
  std::vector<uint32_t> bucket_ends_;
};

}  // namespace rigcal
