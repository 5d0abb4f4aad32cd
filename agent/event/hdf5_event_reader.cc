// SPDX-License-Identifier: Apache-2.0
#include "agent/event/hdf5_event_reader.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "agent/event/hdf5_column.h"
#include "agent/event/hdf5_handle.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr uint32_t kMaxSide = 2048;
constexpr uint16_t kNoPixel = 0xffff;
// Whole microseconds that a double and 64 bits can hold with room for differences.
constexpr double kMaxTimeUs = 4e18;

bool LinkExists(hid_t file, const std::string& path) {
  for (size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
    if (H5Lexists(file, path.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
    if (end == path.npos) return true;
  }
}

H5I_type_t ObjectType(hid_t file, const std::string& path) {
  if (!LinkExists(file, path)) return H5I_BADID;
  const Hdf5Handle object(H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose);
  return object.ok() ? H5Iget_type(object.get()) : H5I_BADID;
}

herr_t TakeName(hid_t, const char* name, const H5L_info_t*, void* names) {
  auto* const list = static_cast<std::vector<std::string>*>(names);
  list->push_back(absl::StrCat("/", name));
  return list->size() < 12 ? 0 : 1;
}

std::string WhatIsThere(hid_t file) {
  std::vector<std::string> names;
  H5Literate(file, H5_INDEX_NAME, H5_ITER_INC, nullptr, TakeName, &names);
  return names.empty() ? "nothing" : absl::StrJoin(names, ", ");
}

struct EventColumns {
  Hdf5Column x, y, p, t;
};

struct TriggerColumns {
  Hdf5Column p, t, id;
  std::optional<Hdf5Column> events_before;
};

absl::StatusOr<EventColumns> OpenCompound(const std::string& path, hid_t file,
                                          const std::string& name) {
  RIGCAL_ASSIGN_OR_RETURN(const auto dataset, Hdf5Dataset::Open(path, file, name));
  EventColumns columns;
  RIGCAL_ASSIGN_OR_RETURN(columns.x, Hdf5Column::Create(dataset, "x"));
  RIGCAL_ASSIGN_OR_RETURN(columns.y, Hdf5Column::Create(dataset, "y"));
  RIGCAL_ASSIGN_OR_RETURN(columns.p, Hdf5Column::Create(dataset, "p"));
  RIGCAL_ASSIGN_OR_RETURN(columns.t, Hdf5Column::Create(dataset, "t"));
  return columns;
}

absl::StatusOr<Hdf5Column> OpenColumn(const std::string& path, hid_t file,
                                      const std::string& name) {
  const std::string& found = LinkExists(file, name) ? name : absl::StrCat(name, "s");
  if (!LinkExists(file, found)) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": there is no dataset ", name, " (nor ", found,
        "); the group /events needs x, y, p and t, or xs, ys, ps and ts, of one length"));
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto dataset, Hdf5Dataset::Open(path, file, found));
  return Hdf5Column::Create(dataset, "");
}

absl::StatusOr<EventColumns> OpenGroup(const std::string& path, hid_t file) {
  EventColumns columns;
  RIGCAL_ASSIGN_OR_RETURN(columns.x, OpenColumn(path, file, "/events/x"));
  RIGCAL_ASSIGN_OR_RETURN(columns.y, OpenColumn(path, file, "/events/y"));
  RIGCAL_ASSIGN_OR_RETURN(columns.p, OpenColumn(path, file, "/events/p"));
  RIGCAL_ASSIGN_OR_RETURN(columns.t, OpenColumn(path, file, "/events/t"));
  std::vector<std::string> lengths;
  bool differ = false;
  for (const Hdf5Column* column : {&columns.x, &columns.y, &columns.p, &columns.t}) {
    lengths.push_back(absl::StrCat(column->Name(), " ", column->dataset().row_count));
    differ = differ || column->dataset().row_count != columns.x.dataset().row_count;
  }
  if (!differ) return columns;
  return absl::InvalidArgumentError(absl::StrCat(
      path, ": the columns have different lengths: ", absl::StrJoin(lengths, ", "),
      " rows; the file was not written to its end, or its parts are not of one recording"));
}

absl::StatusOr<std::optional<TriggerColumns>> OpenTriggers(const std::string& path, hid_t file) {
  const std::string name = "/EXT_TRIGGER/events";
  if (ObjectType(file, name) != H5I_DATASET) return std::nullopt;
  RIGCAL_ASSIGN_OR_RETURN(const auto dataset, Hdf5Dataset::Open(path, file, name));
  TriggerColumns columns;
  RIGCAL_ASSIGN_OR_RETURN(columns.p, Hdf5Column::Create(dataset, "p"));
  RIGCAL_ASSIGN_OR_RETURN(columns.t, Hdf5Column::Create(dataset, "t"));
  RIGCAL_ASSIGN_OR_RETURN(columns.id, Hdf5Column::Create(dataset, "id"));
  RIGCAL_RETURN_IF_ERROR(columns.p.RequireWhole());
  RIGCAL_RETURN_IF_ERROR(columns.id.RequireWhole());
  const std::string before = "/EXT_TRIGGER/cd_events_before";
  if (ObjectType(file, before) == H5I_DATASET) {
    RIGCAL_ASSIGN_OR_RETURN(const auto counts, Hdf5Dataset::Open(path, file, before));
    RIGCAL_ASSIGN_OR_RETURN(columns.events_before, Hdf5Column::Create(counts, ""));
    if (counts->row_count != dataset->row_count) columns.events_before.reset();
  }
  return columns;
}

// Of DSEC: added to every time of the file.
absl::StatusOr<int64_t> ReadTimeOffset(const std::string& path, hid_t file) {
  for (const char* const name : {"/t_offset", "/events/t_offset"}) {
    if (ObjectType(file, name) != H5I_DATASET) continue;
    const Hdf5Handle dataset(H5Dopen2(file, name, H5P_DEFAULT), H5Dclose);
    const Hdf5Handle space(H5Dget_space(dataset.get()), H5Sclose);
    const Hdf5Handle type(H5Dget_type(dataset.get()), H5Tclose);
    long long offset_us = 0;
    if (H5Sget_simple_extent_npoints(space.get()) == 1 && H5Tget_class(type.get()) == H5T_INTEGER &&
        H5Dread(dataset.get(), H5T_NATIVE_LLONG, H5S_ALL, H5S_ALL, H5P_DEFAULT, &offset_us) >= 0 &&
        std::abs(static_cast<double>(offset_us)) < kMaxTimeUs) {
      return offset_us;
    }
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", name, " is not one whole number of microseconds"));
  }
  return 0;
}

std::optional<SensorGeometry> Sides(const std::string& width, const std::string& height) {
  SensorGeometry geometry;
  if (absl::SimpleAtoi(width, &geometry.width) && absl::SimpleAtoi(height, &geometry.height) &&
      geometry.width >= 1 && geometry.width <= kMaxSide && geometry.height >= 1 &&
      geometry.height <= kMaxSide) {
    return geometry;
  }
  return std::nullopt;
}

std::optional<SensorGeometry> GeometryOf(hid_t object) {
  if (const auto text = Hdf5AttributeText(object, "geometry")) {
    const std::vector<std::string> sides = absl::StrSplit(*text, absl::ByAnyChar("x, "));
    if (sides.size() >= 2) return Sides(sides.front(), sides.back());
  }
  const auto width = Hdf5AttributeText(object, "width");
  const auto height = Hdf5AttributeText(object, "height");
  if (width && height) return Sides(*width, *height);
  if (const auto text = Hdf5AttributeText(object, "sensor_resolution")) {
    // Some write the height first, some the width; sensors are wider than high.
    const std::vector<std::string> sides = absl::StrSplit(*text, ' ');
    if (sides.size() < 2) return std::nullopt;
    auto geometry = Sides(sides[0], sides[1]);
    if (geometry && geometry->width < geometry->height) {
      std::swap(geometry->width, geometry->height);
    }
    return geometry;
  }
  return std::nullopt;
}

herr_t TakeField(hid_t object, const char* name, const H5A_info_t*, void* fields) {
  auto* const map = static_cast<std::map<std::string, std::string>*>(fields);
  if (const auto text = Hdf5AttributeText(object, name)) (*map)[name] = *text;
  return map->size() < 64 ? 0 : 1;
}

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
    columns_ = {};
    triggers_.reset();
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

  void ChooseTimeUnit(TimeUnit asked);
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
  EventColumns columns_;
  std::optional<TriggerColumns> triggers_;
  Hdf5Handle narrow_type_;
  int64_t offset_us_ = 0;
  Queue cd_, edges_;
  uint64_t block_cd_row_ = 0, block_edge_row_ = 0;  // at the beginning of the last Read
  std::vector<bool> block_is_edge_;                 // of the last Read
  std::vector<int32_t> x_, y_, p_;
  std::vector<int64_t> whole_times_;
  std::vector<double> fractional_times_;
  std::vector<NarrowRow> narrow_rows_;
};

void Hdf5EventReader::ChooseTimeUnit(TimeUnit asked) {
  facts_.time_unit = asked;
  if (asked != TimeUnit::kAuto) return;
  facts_.time_unit = columns_.t.is_float() ? TimeUnit::kSeconds : TimeUnit::kMicroseconds;
}

absl::Status Hdf5EventReader::Open(const PlainFileOptions& options) {
  const hid_t file = file_.get();
  facts_.format = "HDF5";
  if (ObjectType(file, "/CD/events") == H5I_DATASET) {
    facts_.layout = "/CD/events";
    RIGCAL_ASSIGN_OR_RETURN(columns_, OpenCompound(path_, file, facts_.layout));
  } else if (ObjectType(file, "/events") == H5I_DATASET) {
    facts_.layout = "/events";
    RIGCAL_ASSIGN_OR_RETURN(columns_, OpenCompound(path_, file, facts_.layout));
  } else if (ObjectType(file, "/events") == H5I_GROUP) {
    facts_.layout = "/events/{x,y,p,t}";
    RIGCAL_ASSIGN_OR_RETURN(columns_, OpenGroup(path_, file));
    RIGCAL_ASSIGN_OR_RETURN(offset_us_, ReadTimeOffset(path_, file));
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat(path_, ": neither /CD/events nor /events is there, so where are its events? ",
                     "It holds ", WhatIsThere(file)));
  }
  for (const Hdf5Column* column : {&columns_.x, &columns_.y, &columns_.p}) {
    RIGCAL_RETURN_IF_ERROR(column->RequireWhole());
  }
  RIGCAL_ASSIGN_OR_RETURN(triggers_, OpenTriggers(path_, file));
  ChooseTimeUnit(options.time_unit);
  cd_.row_count = columns_.x.dataset().row_count;
  if (triggers_) edges_.row_count = triggers_->t.dataset().row_count;

  const auto is_narrow = [](const Hdf5Column& column, size_t bytes, bool is_signed) {
    return !column.is_float() && column.byte_count() == bytes && column.is_signed() == is_signed;
  };
  if (&columns_.x.dataset() == &columns_.t.dataset() && is_narrow(columns_.x, 2, false) &&
      is_narrow(columns_.y, 2, false) && is_narrow(columns_.p, 2, true) &&
      is_narrow(columns_.t, 8, true)) {
    narrow_type_ = Hdf5Handle(H5Tcreate(H5T_COMPOUND, sizeof(NarrowRow)), H5Tclose);
    H5Tinsert(narrow_type_.get(), "x", offsetof(NarrowRow, x), H5T_NATIVE_UINT16);
    H5Tinsert(narrow_type_.get(), "y", offsetof(NarrowRow, y), H5T_NATIVE_UINT16);
    H5Tinsert(narrow_type_.get(), "p", offsetof(NarrowRow, p), H5T_NATIVE_INT16);
    H5Tinsert(narrow_type_.get(), "t", offsetof(NarrowRow, t), H5T_NATIVE_INT64);
  }

  for (const char* const name : {"/", "/CD", "/events"}) {
    if (std::string(name) != "/" && !LinkExists(file, name)) continue;
    const Hdf5Handle object(H5Oopen(file, name, H5P_DEFAULT), H5Oclose);
    if (object.ok() && !facts_.geometry) facts_.geometry = GeometryOf(object.get());
  }
  hsize_t position = 0;
  H5Aiterate2(file, H5_INDEX_NAME, H5_ITER_INC, &position, TakeField, &facts_.fields);
  if (offset_us_ != 0) facts_.fields["t_offset"] = absl::StrCat(offset_us_);
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
    event->time_us = std::llround(time_us) + offset_us_;
    return;
  }
  int64_t time_us = whole_times_[index];
  bool too_large = false;
  if (facts_.time_unit == TimeUnit::kSeconds) {
    too_large = __builtin_mul_overflow(time_us, int64_t{1'000'000}, &time_us);
  } else if (facts_.time_unit == TimeUnit::kNanoseconds) {
    time_us = time_us / 1000 - (time_us % 1000 < 0 ? 1 : 0);
  }
  too_large = __builtin_add_overflow(time_us, offset_us_, &event->time_us) || too_large;
  if (too_large) event->kind = PlainEvent::kUnreadable;
}

absl::Status Hdf5EventReader::FillNarrow(uint64_t first, size_t count) {
  narrow_rows_.resize(count);
  RIGCAL_RETURN_IF_ERROR(
      columns_.x.dataset().Read(first, count, narrow_type_.get(), narrow_rows_.data()));
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
    RIGCAL_RETURN_IF_ERROR(columns_.x.Read(first, count, &x_));
    RIGCAL_RETURN_IF_ERROR(columns_.y.Read(first, count, &y_));
    RIGCAL_RETURN_IF_ERROR(columns_.p.Read(first, count, &p_));
    RIGCAL_RETURN_IF_ERROR(ReadTimes(columns_.t, first, count));
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
  RIGCAL_RETURN_IF_ERROR(triggers_->p.Read(first, count, &p_));
  RIGCAL_RETURN_IF_ERROR(triggers_->id.Read(first, count, &x_));
  RIGCAL_RETURN_IF_ERROR(ReadTimes(triggers_->t, first, count));
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
  if (triggers_->events_before) {
    return triggers_->events_before->Read(first, count, &edges_.events_before);
  }
  return absl::OkStatus();
}

bool Hdf5EventReader::Judge(Queue* queue) {
  const PlainEvent& event = queue->block[queue->next];
  if (queue->judged) return true;
  if (event.kind == PlainEvent::kUnreadable) return false;
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
