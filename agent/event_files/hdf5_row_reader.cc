// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_row_reader.h"

#include <cmath>
#include <utility>

#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr uint16_t kNoRowPixel = 0xffff;
// Whole microseconds that a double and 64 bits can hold with room for differences.
constexpr double kMaxRowTimeUs = 4e18;

}  // namespace

Hdf5RowReader::Hdf5RowReader(Hdf5Layout layout, TimeUnit unit)
    : layout_(std::move(layout)), time_unit_(unit) {
  if (!IsNarrow()) return;
  narrow_type_ = Hdf5Handle(H5Tcreate(H5T_COMPOUND, sizeof(NarrowRow)), H5Tclose);
  H5Tinsert(narrow_type_.get(), "x", offsetof(NarrowRow, x), H5T_NATIVE_UINT16);
  H5Tinsert(narrow_type_.get(), "y", offsetof(NarrowRow, y), H5T_NATIVE_UINT16);
  H5Tinsert(narrow_type_.get(), "p", offsetof(NarrowRow, p), H5T_NATIVE_INT16);
  H5Tinsert(narrow_type_.get(), "t", offsetof(NarrowRow, t), H5T_NATIVE_INT64);
}

bool Hdf5RowReader::IsNarrow() const {
  const auto is_narrow = [](const Hdf5Column& column, size_t bytes, bool is_signed) {
    return !column.is_float() && column.byte_count() == bytes && column.is_signed() == is_signed;
  };
  return &layout_.events.x.dataset() == &layout_.events.t.dataset() &&
         is_narrow(layout_.events.x, 2, false) && is_narrow(layout_.events.y, 2, false) &&
         is_narrow(layout_.events.p, 2, true) && is_narrow(layout_.events.t, 8, true);
}

absl::Status Hdf5RowReader::ReadEvents(uint64_t first, size_t count,
                                       std::vector<PlainEvent>* events) {
  events->assign(count, PlainEvent{});
  if (narrow_type_.ok()) {
    RIGCAL_RETURN_IF_ERROR(ReadNarrow(first, count, events));
  } else {
    RIGCAL_RETURN_IF_ERROR(layout_.events.x.Read(first, count, &x_));
    RIGCAL_RETURN_IF_ERROR(layout_.events.y.Read(first, count, &y_));
    RIGCAL_RETURN_IF_ERROR(layout_.events.p.Read(first, count, &p_));
    RIGCAL_RETURN_IF_ERROR(ReadTimes(layout_.events.t, first, count));
    const auto pixel = [](int32_t value) {
      return value < 0 || value > kNoRowPixel ? kNoRowPixel : static_cast<uint16_t>(value);
    };
    for (size_t i = 0; i < count; ++i) {
      PlainEvent& event = (*events)[i];
      event.x = pixel(x_[i]);
      event.y = pixel(y_[i]);
      event.kind = p_[i] == 1                  ? PlainEvent::kOn
                   : p_[i] == 0 || p_[i] == -1 ? PlainEvent::kOff
                                               : PlainEvent::kUnreadable;
    }
  }
  for (size_t i = 0; i < count; ++i) SetTime(i, &(*events)[i]);
  return absl::OkStatus();
}

absl::Status Hdf5RowReader::ReadNarrow(uint64_t first, size_t count,
                                       std::vector<PlainEvent>* events) {
  narrow_rows_.resize(count);
  RIGCAL_RETURN_IF_ERROR(
      layout_.events.x.dataset().Read(first, count, narrow_type_.get(), narrow_rows_.data()));
  whole_times_.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const NarrowRow& row = narrow_rows_[i];
    whole_times_[i] = row.t;
    (*events)[i] = {
        .time_us = 0,
        .x = row.x,
        .y = row.y,
        .kind = row.p == 1                  ? PlainEvent::kOn
                : row.p == 0 || row.p == -1 ? PlainEvent::kOff
                                            : PlainEvent::kUnreadable,
    };
  }
  return absl::OkStatus();
}

absl::Status Hdf5RowReader::ReadTriggers(uint64_t first, size_t count,
                                         std::vector<PlainEvent>* triggers,
                                         std::vector<int64_t>* events_before) {
  triggers->assign(count, PlainEvent{});
  RIGCAL_RETURN_IF_ERROR(layout_.triggers->p.Read(first, count, &p_));
  RIGCAL_RETURN_IF_ERROR(layout_.triggers->id.Read(first, count, &x_));
  RIGCAL_RETURN_IF_ERROR(ReadTimes(layout_.triggers->t, first, count));
  for (size_t i = 0; i < count; ++i) {
    PlainEvent& event = (*triggers)[i];
    const bool readable = p_[i] >= -1 && p_[i] <= 1 && x_[i] >= 0 && x_[i] <= 0xff;
    event.kind = !readable    ? PlainEvent::kUnreadable
                 : p_[i] == 1 ? PlainEvent::kTriggerRising
                              : PlainEvent::kTriggerFalling;
    event.channel = readable ? static_cast<uint8_t>(x_[i]) : uint8_t{0};
    SetTime(i, &event);
  }
  events_before->clear();
  if (layout_.triggers->events_before) {
    return layout_.triggers->events_before->Read(first, count, events_before);
  }
  return absl::OkStatus();
}

absl::Status Hdf5RowReader::ReadTimes(const Hdf5Column& column, uint64_t first, size_t count) {
  if (column.is_float()) {
    whole_times_.clear();
    return column.Read(first, count, &fractional_times_);
  }
  return column.Read(first, count, &whole_times_);
}

void Hdf5RowReader::SetTime(size_t index, PlainEvent* event) const {
  if (whole_times_.empty()) {
    const double scale = time_unit_ == TimeUnit::kSeconds       ? 1e6
                         : time_unit_ == TimeUnit::kNanoseconds ? 1e-3
                                                                : 1;
    const double time_us = fractional_times_[index] * scale;
    if (!(std::abs(time_us) < kMaxRowTimeUs)) {
      event->kind = PlainEvent::kUnreadable;
      return;
    }
    event->time_us = std::llround(time_us) + layout_.time_offset_us;
    return;
  }
  int64_t time_us = whole_times_[index];
  bool too_large = false;
  if (time_unit_ == TimeUnit::kSeconds) {
    too_large = __builtin_mul_overflow(time_us, int64_t{1'000'000}, &time_us);
  } else if (time_unit_ == TimeUnit::kNanoseconds) {
    time_us = time_us / 1000 - (time_us % 1000 < 0 ? 1 : 0);
  }
  too_large = __builtin_add_overflow(time_us, layout_.time_offset_us, &event->time_us) || too_large;
  if (too_large) event->kind = PlainEvent::kUnreadable;
}

}  // namespace rigcal::agent
