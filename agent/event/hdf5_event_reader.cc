// SPDX-License-Identifier: Apache-2.0
#include "agent/event/hdf5_event_reader.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/event/hdf5_handle.h"
#include "agent/event/hdf5_layout.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr uint16_t kNoPixel = 0xffff;
// Whole microseconds that a double and 64 bits can hold with room for differences.
constexpr double kMaxTimeUs = 4e18;

// As Prophesee's own files have it, and this project's.
struct NarrowRow {
  uint16_t x, y;
  int16_t p;
  int64_t t;
};

class Hdf5EventReader : public PlainEventReader {
 public:
  // The file's members are closed in the order that HDF5 wants: columns first.
  Hdf5EventReader(std::string path, Hdf5Handle file)
      : path_(std::move(path)), file_(std::move(file)) {}
  ~Hdf5EventReader() override {
    const Hdf5Lock lock;
    narrow_type_.Reset();
    layout_ = {};
    file_.Reset();
  }

  absl::Status Open(const PlainFileOptions& options);
  const PlainFileFacts& facts() const override { return facts_; }
  absl::Status Read(size_t max_count, std::vector<PlainEvent>* events) override;
  std::string PlaceOf(size_t index) const override;

 private:
  static constexpr size_t kBlockRows = size_t{1} << 16;

  // Events or triggers read ahead.
  struct Queue {
    std::vector<PlainEvent> block;
    std::vector<int64_t> events_before;  // of triggers, where the file notes it
    size_t next = 0;                     // in the block
    uint64_t row = 0;                    // of the file, of block.front()
    uint64_t row_count = 0;
    PlainClock clock;
    uint64_t epoch = 0;
    bool judged = false;  // whether block[next] has gone through the clock

    bool empty() const { return next == block.size(); }
    uint64_t at() const { return row + next; }
  };

  absl::Status ChooseTimeUnit(TimeUnit asked);
  absl::Status FillEvents();
  absl::Status FillNarrow(uint64_t first, size_t count);
  absl::Status FillTriggers();
  absl::Status ReadTimes(const Hdf5Column& column, uint64_t first, size_t count);
  void SetTime(size_t index, PlainEvent* event) const;
  // Lets the queue's next event go through its clock; false: it is damaged and goes by itself.
  static bool Judge(Queue* queue);
  bool TriggerIsNext();

  std::string path_;
  Hdf5Handle file_;
  PlainFileFacts facts_;
  Hdf5Layout layout_;
  Hdf5Handle narrow_type_;
  Queue cd_, edges_;
  uint64_t block_cd_row_ = 0, block_edge_row_ = 0;  // at the beginning of the last Read
  std::vector<bool> block_is_edge_;                 // of the last Read
  std::vector<int32_t> x_, y_, p_;
  std::vector<int64_t> whole_times_;
  std::vector<double> fractional_times_;
  std::vector<NarrowRow> narrow_rows_;
};

absl::Status Hdf5EventReader::ChooseTimeUnit(TimeUnit asked) {
  facts_.time_unit = asked;
  if (asked != TimeUnit::kAuto) return absl::OkStatus();
  const Hdf5Column& t = layout_.events.t;
  facts_.time_unit = t.is_float() ? TimeUnit::kSeconds : TimeUnit::kMicroseconds;
  if (t.is_float() || t.dataset().row_count == 0) return absl::OkStatus();
  RIGCAL_RETURN_IF_ERROR(t.Read(0, 1, &whole_times_));
  if (std::abs(whole_times_[0]) <= PlainClock::kMaxUs) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(path_, ": ", t.Name(), " begins with ", whole_times_[0],
                   ", too large for microseconds; say what it is: time=ns"));
}

absl::Status Hdf5EventReader::Open(const PlainFileOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(layout_, Hdf5Layout::Open(path_, file_.get()));
  facts_.format = "HDF5";
  facts_.layout = layout_.name;
  facts_.geometry = layout_.geometry;
  facts_.fields = layout_.fields;
  RIGCAL_RETURN_IF_ERROR(ChooseTimeUnit(options.time_unit));
  cd_.row_count = layout_.events.x.dataset().row_count;
  if (layout_.triggers) edges_.row_count = layout_.triggers->t.dataset().row_count;

  const auto is_narrow = [](const Hdf5Column& column, size_t bytes, bool is_signed) {
    return !column.is_float() && column.byte_count() == bytes && column.is_signed() == is_signed;
  };
  if (&layout_.events.x.dataset() == &layout_.events.t.dataset() &&
      is_narrow(layout_.events.x, 2, false) && is_narrow(layout_.events.y, 2, false) &&
      is_narrow(layout_.events.p, 2, true) && is_narrow(layout_.events.t, 8, true)) {
    narrow_type_ = Hdf5Handle(H5Tcreate(H5T_COMPOUND, sizeof(NarrowRow)), H5Tclose);
    H5Tinsert(narrow_type_.get(), "x", offsetof(NarrowRow, x), H5T_NATIVE_UINT16);
    H5Tinsert(narrow_type_.get(), "y", offsetof(NarrowRow, y), H5T_NATIVE_UINT16);
    H5Tinsert(narrow_type_.get(), "p", offsetof(NarrowRow, p), H5T_NATIVE_INT16);
    H5Tinsert(narrow_type_.get(), "t", offsetof(NarrowRow, t), H5T_NATIVE_INT64);
  }
  return absl::OkStatus();
}

absl::Status Hdf5EventReader::ReadTimes(const Hdf5Column& column, uint64_t first, size_t count) {
  if (column.is_float()) {
    whole_times_.clear();
    return column.Read(first, count, &fractional_times_);
  }
  return column.Read(first, count, &whole_times_);
}

void Hdf5EventReader::SetTime(size_t index, PlainEvent* event) const {
  if (whole_times_.empty()) {
    const double scale = facts_.time_unit == TimeUnit::kSeconds       ? 1e6
                         : facts_.time_unit == TimeUnit::kNanoseconds ? 1e-3
                                                                      : 1;
    const double time_us = fractional_times_[index] * scale;
    if (!(std::abs(time_us) < kMaxTimeUs)) {
      event->kind = PlainEvent::kUnreadable;
      return;
    }
    event->time_us = std::llround(time_us) + layout_.time_offset_us;
    return;
  }
  int64_t time_us = whole_times_[index];
  bool too_large = false;
  if (facts_.time_unit == TimeUnit::kSeconds) {
    too_large = __builtin_mul_overflow(time_us, int64_t{1'000'000}, &time_us);
  } else if (facts_.time_unit == TimeUnit::kNanoseconds) {
    time_us = time_us / 1000 - (time_us % 1000 < 0 ? 1 : 0);
  }
  too_large = __builtin_add_overflow(time_us, layout_.time_offset_us, &event->time_us) || too_large;
  if (too_large) event->kind = PlainEvent::kUnreadable;
}

absl::Status Hdf5EventReader::FillNarrow(uint64_t first, size_t count) {
  narrow_rows_.resize(count);
  RIGCAL_RETURN_IF_ERROR(
      layout_.events.x.dataset().Read(first, count, narrow_type_.get(), narrow_rows_.data()));
  whole_times_.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const NarrowRow& row = narrow_rows_[i];
    whole_times_[i] = row.t;
    cd_.block[i] = {
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

absl::Status Hdf5EventReader::FillEvents() {
  const uint64_t first = cd_.at();
  const auto count = static_cast<size_t>(std::min<uint64_t>(kBlockRows, cd_.row_count - first));
  cd_.row = first;
  cd_.next = 0;
  cd_.block.assign(count, PlainEvent{});
  if (narrow_type_.ok()) {
    RIGCAL_RETURN_IF_ERROR(FillNarrow(first, count));
  } else {
    RIGCAL_RETURN_IF_ERROR(layout_.events.x.Read(first, count, &x_));
    RIGCAL_RETURN_IF_ERROR(layout_.events.y.Read(first, count, &y_));
    RIGCAL_RETURN_IF_ERROR(layout_.events.p.Read(first, count, &p_));
    RIGCAL_RETURN_IF_ERROR(ReadTimes(layout_.events.t, first, count));
    const auto pixel = [](int32_t value) {
      return value < 0 || value > kNoPixel ? kNoPixel : static_cast<uint16_t>(value);
    };
    for (size_t i = 0; i < count; ++i) {
      cd_.block[i].x = pixel(x_[i]);
      cd_.block[i].y = pixel(y_[i]);
      cd_.block[i].kind = p_[i] == 1                  ? PlainEvent::kOn
                          : p_[i] == 0 || p_[i] == -1 ? PlainEvent::kOff
                                                      : PlainEvent::kUnreadable;
    }
  }
  for (size_t i = 0; i < count; ++i) SetTime(i, &cd_.block[i]);
  return absl::OkStatus();
}

absl::Status Hdf5EventReader::FillTriggers() {
  const uint64_t first = edges_.at();
  const auto count = static_cast<size_t>(std::min<uint64_t>(kBlockRows, edges_.row_count - first));
  edges_.row = first;
  edges_.next = 0;
  edges_.block.assign(count, PlainEvent{});
  RIGCAL_RETURN_IF_ERROR(layout_.triggers->p.Read(first, count, &p_));
  RIGCAL_RETURN_IF_ERROR(layout_.triggers->id.Read(first, count, &x_));
  RIGCAL_RETURN_IF_ERROR(ReadTimes(layout_.triggers->t, first, count));
  for (size_t i = 0; i < count; ++i) {
    PlainEvent& event = edges_.block[i];
    const bool readable = p_[i] >= -1 && p_[i] <= 1 && x_[i] >= 0 && x_[i] <= 0xff;
    event.kind = !readable    ? PlainEvent::kUnreadable
                 : p_[i] == 1 ? PlainEvent::kTriggerRising
                              : PlainEvent::kTriggerFalling;
    event.channel = readable ? static_cast<uint8_t>(x_[i]) : uint8_t{0};
    SetTime(i, &event);
  }
  edges_.events_before.clear();
  if (layout_.triggers->events_before) {
    return layout_.triggers->events_before->Read(first, count, &edges_.events_before);
  }
  return absl::OkStatus();
}

bool Hdf5EventReader::Judge(Queue* queue) {
  const PlainEvent& event = queue->block[queue->next];
  if (queue->judged) return true;
  if (!IsReadable(event)) return false;
  queue->judged = true;
  if (queue->clock.Take(event.time_us)) return true;
  const bool sees_next = queue->next + 1 < queue->block.size();
  const int64_t next_us = sees_next ? queue->block[queue->next + 1].time_us : 0;
  switch (queue->clock.Decide(event.time_us, sees_next ? &next_us : nullptr)) {
    case PlainClock::Verdict::kDamaged:
      return false;
    case PlainClock::Verdict::kStepBack:
      ++queue->epoch;
      return true;
    default:
      return true;
  }
}

bool Hdf5EventReader::TriggerIsNext() {
  if (edges_.empty()) return false;
  if (cd_.empty()) return true;
  if (!edges_.events_before.empty()) {
    const int64_t before = edges_.events_before[edges_.next];
    return before <= static_cast<int64_t>(cd_.at());
  }
  if (!Judge(&edges_)) return true;
  if (!Judge(&cd_)) return false;
  if (edges_.epoch != cd_.epoch) return edges_.epoch < cd_.epoch;
  return edges_.block[edges_.next].time_us <= cd_.block[cd_.next].time_us;
}

absl::Status Hdf5EventReader::Read(size_t max_count, std::vector<PlainEvent>* events) {
  const Hdf5Lock lock;
  events->clear();
  block_is_edge_.clear();
  block_cd_row_ = cd_.at();
  block_edge_row_ = edges_.at();
  while (events->size() < max_count) {
    if (cd_.empty() && cd_.at() < cd_.row_count) RIGCAL_RETURN_IF_ERROR(FillEvents());
    if (edges_.empty() && edges_.at() < edges_.row_count) RIGCAL_RETURN_IF_ERROR(FillTriggers());
    if (edges_.empty()) {
      // Nearly always so: all of one kind.
      if (cd_.empty()) break;
      const size_t count = std::min(cd_.block.size() - cd_.next, max_count - events->size());
      const auto begin = cd_.block.begin() + static_cast<std::ptrdiff_t>(cd_.next);
      events->insert(events->end(), begin, begin + static_cast<std::ptrdiff_t>(count));
      block_is_edge_.resize(events->size(), false);
      cd_.next += count;
      continue;
    }
    const bool is_edge = TriggerIsNext();
    Queue& queue = is_edge ? edges_ : cd_;
    events->push_back(queue.block[queue.next++]);
    queue.judged = false;
    block_is_edge_.push_back(is_edge);
  }
  return absl::OkStatus();
}

std::string Hdf5EventReader::PlaceOf(size_t index) const {
  if (index >= block_is_edge_.size()) return "";
  const auto end = block_is_edge_.begin() + static_cast<std::ptrdiff_t>(index);
  const auto edges = static_cast<uint64_t>(std::count(block_is_edge_.begin(), end, true));
  if (block_is_edge_[index]) {
    return absl::StrCat("row ", block_edge_row_ + edges, " of /EXT_TRIGGER/events");
  }
  return absl::StrCat("row ", block_cd_row_ + index - edges, " of ", facts_.layout);
}

}  // namespace

absl::StatusOr<std::unique_ptr<PlainEventReader>> OpenHdf5Events(const std::string& path,
                                                                 const PlainFileOptions& options) {
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0 || ::access(path.c_str(), R_OK) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  }
  const Hdf5Lock lock;
  Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": HDF5 cannot open it: ", Hdf5Reason(),
        "; was it copied or written to its end? (h5clear -s mends a file that was not closed)"));
  }
  auto reader = std::make_unique<Hdf5EventReader>(path, std::move(file));
  const absl::Status opened = reader->Open(options);
  return opened.ok() ? absl::StatusOr<std::unique_ptr<PlainEventReader>>(std::move(reader))
                     : absl::StatusOr<std::unique_ptr<PlainEventReader>>(opened);
}

}  // namespace rigcal::agent
