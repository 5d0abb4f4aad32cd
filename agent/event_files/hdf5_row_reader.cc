// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_row_reader.h"

#include <utility>

#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

PlainEvent::Kind KindOf(int polarity) {
  return polarity == 1                     ? PlainEvent::kOn
         : polarity == 0 || polarity == -1 ? PlainEvent::kOff
                                           : PlainEvent::kUnreadable;
}

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
  const auto& [x, y, p, t] = layout_.events;
  return &x.dataset() == &t.dataset() && x.Is(H5T_NATIVE_UINT16) && y.Is(H5T_NATIVE_UINT16) &&
         p.Is(H5T_NATIVE_INT16) && t.Is(H5T_NATIVE_INT64);
}

absl::Status Hdf5RowReader::ReadEvents(uint64_t first, size_t count,
                                       std::vector<PlainEvent>* events) {
  events->assign(count, PlainEvent{});
  const auto& [x, y, p, t] = layout_.events;
  if (narrow_type_.ok()) {
    narrow_rows_.resize(count);
    RIGCAL_RETURN_IF_ERROR(x.dataset().Read(first, count, narrow_type_.get(), narrow_rows_.data()));
    whole_times_.resize(count);
    for (size_t i = 0; i < count; ++i) {
      const NarrowRow& row = narrow_rows_[i];
      whole_times_[i] = row.t;
      (*events)[i] = {.time_us = 0, .x = row.x, .y = row.y, .kind = KindOf(row.p)};
    }
  } else {
    RIGCAL_RETURN_IF_ERROR(x.Read(first, count, &x_));
    RIGCAL_RETURN_IF_ERROR(y.Read(first, count, &y_));
    RIGCAL_RETURN_IF_ERROR(p.Read(first, count, &p_));
    RIGCAL_RETURN_IF_ERROR(ReadTimes(t, first, count));
    for (size_t i = 0; i < count; ++i) {
      (*events)[i] = {
          .time_us = 0, .x = PlainPixel(x_[i]), .y = PlainPixel(y_[i]), .kind = KindOf(p_[i])};
    }
  }
  for (size_t i = 0; i < count; ++i) SetTime(i, &(*events)[i]);
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
  int64_t time_us = 0;
  const bool fits = whole_times_.empty()
                        ? ToMicroseconds(fractional_times_[index], time_unit_, &time_us)
                        : ToMicroseconds(whole_times_[index], time_unit_, &time_us);
  if (!fits || __builtin_add_overflow(time_us, layout_.time_offset_us, &event->time_us)) {
    event->kind = PlainEvent::kUnreadable;
  }
}

}  // namespace rigcal::agent
