// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_event_reader.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/event_files/hdf5_layout.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Makes events and triggers of rows of an HDF5 file's columns, with times in microseconds; a row
// whose values make none becomes PlainEvent::kUnreadable. Hold an Hdf5Lock around everything, the
// end included.
class Hdf5RowReader {
 public:
  // The layout's times are of `unit`, which is not kAuto.
  Hdf5RowReader(Hdf5Layout layout, TimeUnit unit);

  // Replaces `events` by `count` rows from `first`, which must be there. DATA_LOSS: they cannot be
  // read.
  absl::Status ReadEvents(uint64_t first, size_t count, std::vector<PlainEvent>* events);
  // Likewise, of a layout with triggers. `events_before`: the number of events before
  // each; empty if the file does not have it.
  absl::Status ReadTriggers(uint64_t first, size_t count, std::vector<PlainEvent>* triggers,
                            std::vector<int64_t>* events_before);

 private:
  // As files of the compound layout mostly have it.
  struct NarrowRow {
    uint16_t x, y;
    int16_t p;
    int64_t t;
  };

  absl::Status ReadTimes(const Hdf5Column& column, uint64_t first, size_t count);
  void SetTime(size_t index, PlainEvent* event) const;

  Hdf5Layout layout_;
  TimeUnit time_unit_;
  Hdf5Handle narrow_type_;  // none: rows are not narrow
  std::vector<int32_t> x_, y_, p_;
  std::vector<int64_t> whole_times_;
  std::vector<double> fractional_times_;
  std::vector<NarrowRow> narrow_rows_;
};

PlainEvent::Kind KindOf(int polarity) {
  // 255 is ON of masks stored as bytes.
  return polarity == 1 || polarity == 255  ? PlainEvent::kOn
         : polarity == 0 || polarity == -1 ? PlainEvent::kOff
                                           : PlainEvent::kUnreadable;
}

Hdf5RowReader::Hdf5RowReader(Hdf5Layout layout, TimeUnit unit)
    : layout_(std::move(layout)), time_unit_(unit) {
  const auto& [x, y, p, t] = layout_.events;
  if (&x.dataset() != &t.dataset() || !x.Is(H5T_NATIVE_UINT16) || !y.Is(H5T_NATIVE_UINT16) ||
      !p.Is(H5T_NATIVE_INT16) || !t.Is(H5T_NATIVE_INT64)) {
    return;
  }
  narrow_type_ = Hdf5Handle(H5Tcreate(H5T_COMPOUND, sizeof(NarrowRow)), H5Tclose);
  H5Tinsert(narrow_type_.get(), "x", offsetof(NarrowRow, x), H5T_NATIVE_UINT16);
  H5Tinsert(narrow_type_.get(), "y", offsetof(NarrowRow, y), H5T_NATIVE_UINT16);
  H5Tinsert(narrow_type_.get(), "p", offsetof(NarrowRow, p), H5T_NATIVE_INT16);
  H5Tinsert(narrow_type_.get(), "t", offsetof(NarrowRow, t), H5T_NATIVE_INT64);
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

class Hdf5EventReader : public PlainEventReader {
 public:
  // The file's members are closed in the order that HDF5 wants: columns first.
  Hdf5EventReader(std::string path, Hdf5Handle file)
      : path_(std::move(path)), file_(std::move(file)) {}
  ~Hdf5EventReader() override {
    const Hdf5Lock lock;
    rows_.reset();
    file_.Reset();
  }

  absl::Status Open(const EventFileOptions& options);
  absl::Status Read(size_t max_count, std::vector<PlainEvent>* events) override;
  std::string PlaceInBlock(size_t index) const override;

 private:
  static constexpr size_t kBlockRows = size_t{1} << 16;

  // Events or triggers read ahead.
  struct Queue {
    std::vector<PlainEvent> block;
    std::vector<int64_t> events_before;  // of triggers, if the file has it
    size_t next = 0;                     // in the block
    uint64_t row = 0;                    // of the file, of block.front()
    uint64_t row_count = 0;
    PlainClock clock;
    uint64_t epoch = 0;
    bool judged = false;  // whether block[next] has gone through the clock

    bool empty() const { return next == block.size(); }
    uint64_t at() const { return row + next; }
    // The block is to hold the rows from at() on; returns how many. 0: it is not at its end, or
    // there are no more.
    size_t BeginBlock() {
      if (!empty() || at() == row_count) return 0;
      row = at();
      next = 0;
      return static_cast<size_t>(std::min<uint64_t>(kBlockRows, row_count - row));
    }
  };

  absl::Status ChooseTimeUnit(const Hdf5Column& t, TimeUnit asked);
  absl::Status Fill();  // what is empty and not at its end
  // Lets the queue's next event go through its clock; false: it is damaged and goes by itself.
  static bool Judge(Queue* queue);
  bool TriggerIsNext();

  std::string path_;
  Hdf5Handle file_;
  std::optional<Hdf5RowReader> rows_;
  Queue cd_, edges_;
  uint64_t block_cd_row_ = 0, block_edge_row_ = 0;  // at the beginning of the last Read
  std::vector<bool> block_is_edge_;                 // of the last Read
};

absl::Status Hdf5EventReader::ChooseTimeUnit(const Hdf5Column& t, TimeUnit asked) {
  header_.time_unit = asked;
  if (asked != TimeUnit::kAuto) return absl::OkStatus();
  header_.time_unit = t.is_float() ? TimeUnit::kSeconds : TimeUnit::kMicroseconds;
  if (t.is_float() || t.dataset().row_count == 0) return absl::OkStatus();
  std::vector<int64_t> first;
  RIGCAL_RETURN_IF_ERROR(t.Read(0, 1, &first));
  if (std::abs(first[0]) <= PlainClock::kMaxUs) return absl::OkStatus();
  return InvalidFile(path_, ": ", t.Name(), " begins with ", first[0],
                     ", too large for microseconds; say what it is: time=ns");
}

absl::Status Hdf5EventReader::Open(const EventFileOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(Hdf5Layout layout, Hdf5Layout::Open(path_, file_.get()));
  header_ = layout.header;
  RIGCAL_RETURN_IF_ERROR(ChooseTimeUnit(layout.events.t, options.time_unit));
  cd_.row_count = layout.events.x.dataset().row_count;
  if (layout.triggers) edges_.row_count = layout.triggers->t.dataset().row_count;
  rows_.emplace(std::move(layout), header_.time_unit);
  return absl::OkStatus();
}

absl::Status Hdf5EventReader::Fill() {
  if (const size_t count = cd_.BeginBlock(); count > 0) {
    RIGCAL_RETURN_IF_ERROR(rows_->ReadEvents(cd_.row, count, &cd_.block));
  }
  const size_t count = edges_.BeginBlock();
  if (count == 0) return absl::OkStatus();
  return rows_->ReadTriggers(edges_.row, count, &edges_.block, &edges_.events_before);
}

bool Hdf5EventReader::Judge(Queue* queue) {
  const PlainEvent& event = queue->block[queue->next];
  if (queue->judged) return true;
  if (!IsReadable(event)) return false;
  queue->judged = true;
  if (queue->clock.Take(event.time_us)) return true;
  const bool sees_next = queue->next + 1 < queue->block.size();
  const int64_t next_us = sees_next ? queue->block[queue->next + 1].time_us : 0;
  const auto verdict = queue->clock.Decide(event.time_us, sees_next ? &next_us : nullptr);
  queue->epoch += verdict == PlainClock::Verdict::kStepBack ? 1 : 0;
  return verdict != PlainClock::Verdict::kDamaged;
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
    RIGCAL_RETURN_IF_ERROR(Fill());
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

std::string Hdf5EventReader::PlaceInBlock(size_t index) const {
  const auto end = block_is_edge_.begin() + static_cast<std::ptrdiff_t>(index);
  const auto edges = static_cast<uint64_t>(std::count(block_is_edge_.begin(), end, true));
  if (block_is_edge_[index]) {
    return absl::StrCat("row ", block_edge_row_ + edges, " of /EXT_TRIGGER/events");
  }
  return absl::StrCat("row ", block_cd_row_ + index - edges, " of ", header_.layout);
}

}  // namespace

absl::StatusOr<std::unique_ptr<PlainEventReader>> OpenHdf5Events(const std::string& path,
                                                                 const EventFileOptions& options) {
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0 || ::access(path.c_str(), R_OK) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  }
  const Hdf5Lock lock;
  Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) {
    return InvalidFile(
        path, ": HDF5 cannot open it: ", Hdf5Reason(),
        "; was it copied or written to its end? (h5clear -s mends a file that was not closed)");
  }
  auto reader = std::make_unique<Hdf5EventReader>(path, std::move(file));
  RIGCAL_RETURN_IF_ERROR(reader->Open(options));
  return reader;
}

}  // namespace rigcal::agent
