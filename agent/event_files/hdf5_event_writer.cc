// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_event_writer.h"

#include <cstddef>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/event_files/hdf5_handle.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kChunkRows = size_t{1} << 16;
// The least that deflate can do: more of it is several times slower for a few per cent.
constexpr unsigned kDeflateLevel = 1;

struct CdRow {
  uint16_t x, y;
  int16_t p;
  int64_t t;
};

struct TriggerRow {
  int16_t p;
  int64_t t;
  int16_t id;
};

// A dataset that grows by chunks.
template <typename Row>
class GrowingDataset {
 public:
  absl::Status Create(const std::string& file, hid_t parent, const char* name, Hdf5Handle type) {
    file_ = file;
    name_ = name;
    type_ = std::move(type);
    const hsize_t none = 0, unlimited = H5S_UNLIMITED, chunk = kChunkRows;
    const Hdf5Handle space(H5Screate_simple(1, &none, &unlimited), H5Sclose);
    const Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(creation.get(), 1, &chunk);
    H5Pset_shuffle(creation.get());
    H5Pset_deflate(creation.get(), kDeflateLevel);
    dataset_ = Hdf5Handle(H5Dcreate2(parent, name, type_.get(), space.get(), H5P_DEFAULT,
                                     creation.get(), H5P_DEFAULT),
                          H5Dclose);
    return dataset_.ok() ? absl::OkStatus() : Failed();
  }

  absl::Status Add(const Row& row) {
    rows_.push_back(row);
    return rows_.size() < kChunkRows ? absl::OkStatus() : Flush();
  }

  absl::Status Flush() {
    if (rows_.empty()) return absl::OkStatus();
    const hsize_t first = written_, count = rows_.size(), size = written_ + rows_.size();
    if (H5Dset_extent(dataset_.get(), &size) < 0) return Failed();
    const Hdf5Handle to(H5Dget_space(dataset_.get()), H5Sclose);
    const Hdf5Handle from(H5Screate_simple(1, &count, nullptr), H5Sclose);
    H5Sselect_hyperslab(to.get(), H5S_SELECT_SET, &first, nullptr, &count, nullptr);
    if (H5Dwrite(dataset_.get(), type_.get(), from.get(), to.get(), H5P_DEFAULT, rows_.data()) <
        0) {
      return Failed();
    }
    written_ = size;
    rows_.clear();
    return absl::OkStatus();
  }

  uint64_t count() const { return written_ + rows_.size(); }
  void Close() {
    dataset_.Reset();
    type_.Reset();
  }

 private:
  absl::Status Failed() const {
    return absl::DataLossError(
        absl::StrCat("cannot write ", name_, " of ", file_, ": ", Hdf5Reason()));
  }

  std::string file_, name_;
  Hdf5Handle type_, dataset_;
  std::vector<Row> rows_;
  hsize_t written_ = 0;
};

struct Member {
  const char* name;
  size_t offset;
  hid_t type;
};

Hdf5Handle Compound(size_t size, std::initializer_list<Member> members) {
  Hdf5Handle type(H5Tcreate(H5T_COMPOUND, size), H5Tclose);
  for (const auto& [name, offset, member] : members) H5Tinsert(type.get(), name, offset, member);
  return type;
}

Hdf5Handle Plain(hid_t type) { return {H5Tcopy(type), H5Tclose}; }

class Hdf5EventWriter : public PlainEventWriter {
 public:
  Hdf5EventWriter(std::string path, Hdf5Handle file, Hdf5EventLayout layout)
      : path_(std::move(path)), file_(std::move(file)), layout_(layout) {}
  ~Hdf5EventWriter() override {
    const Hdf5Lock lock;
    Close();
  }

  absl::Status Begin(const PlainFileFront& front);
  absl::Status Write(std::span<const PlainEvent> events) override;
  absl::Status Finish() override;

 private:
  absl::Status AddAttribute(const std::string& name, const std::string& value);
  absl::Status WriteEvent(const PlainEvent& event);
  absl::Status WriteTrigger(const PlainEvent& event);
  uint64_t event_count() const {
    return layout_ == Hdf5EventLayout::kCompound ? cd_.count() : t_.count();
  }
  template <typename Visit>
  void ForEachDataset(Visit visit) {
    std::apply([&](auto&... datasets) { (visit(datasets), ...); },
               std::tie(cd_, triggers_, events_before_, x_, y_, p_, t_));
  }
  void Close() {
    ForEachDataset([](auto& dataset) { dataset.Close(); });
  }

  const std::string path_;
  Hdf5Handle file_;
  const Hdf5EventLayout layout_;
  GrowingDataset<CdRow> cd_;
  GrowingDataset<TriggerRow> triggers_;
  GrowingDataset<uint64_t> events_before_;
  GrowingDataset<uint16_t> x_, y_;
  GrowingDataset<uint8_t> p_;
  GrowingDataset<int64_t> t_;
};

absl::Status Hdf5EventWriter::AddAttribute(const std::string& name, const std::string& value) {
  const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), value.size() + 1);
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle attribute(
      H5Acreate2(file_.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
  if (attribute.ok() && H5Awrite(attribute.get(), type.get(), value.c_str()) >= 0) {
    return absl::OkStatus();
  }
  return absl::DataLossError(
      absl::StrCat("cannot write attribute ", name, " of ", path_, ": ", Hdf5Reason()));
}

absl::Status Hdf5EventWriter::Begin(const PlainFileFront& front) {
  PlainFileFront said = front;
  if (front.geometry) {
    said.fields["width"] = absl::StrCat(front.geometry->width);
    said.fields["height"] = absl::StrCat(front.geometry->height);
    said.fields["geometry"] = absl::StrCat(front.geometry->width, "x", front.geometry->height);
  }
  for (const auto& [name, value] : said.fields) {
    RIGCAL_RETURN_IF_ERROR(AddAttribute(name, value));
  }
  const auto group = [this](const char* name) {
    return Hdf5Handle(H5Gcreate2(file_.get(), name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                      H5Gclose);
  };
  if (layout_ == Hdf5EventLayout::kColumns) {
    const Hdf5Handle events = group("events");
    RIGCAL_RETURN_IF_ERROR(x_.Create(path_, events.get(), "x", Plain(H5T_STD_U16LE)));
    RIGCAL_RETURN_IF_ERROR(y_.Create(path_, events.get(), "y", Plain(H5T_STD_U16LE)));
    RIGCAL_RETURN_IF_ERROR(p_.Create(path_, events.get(), "p", Plain(H5T_STD_U8LE)));
    return t_.Create(path_, events.get(), "t", Plain(H5T_STD_I64LE));
  }
  const Hdf5Handle cd = group("CD");
  RIGCAL_RETURN_IF_ERROR(
      cd_.Create(path_, cd.get(), "events",
                 Compound(sizeof(CdRow), {{"x", offsetof(CdRow, x), H5T_STD_U16LE},
                                          {"y", offsetof(CdRow, y), H5T_STD_U16LE},
                                          {"p", offsetof(CdRow, p), H5T_STD_I16LE},
                                          {"t", offsetof(CdRow, t), H5T_STD_I64LE}})));
  const Hdf5Handle edges = group("EXT_TRIGGER");
  RIGCAL_RETURN_IF_ERROR(triggers_.Create(
      path_, edges.get(), "events",
      Compound(sizeof(TriggerRow), {{"p", offsetof(TriggerRow, p), H5T_STD_I16LE},
                                    {"t", offsetof(TriggerRow, t), H5T_STD_I64LE},
                                    {"id", offsetof(TriggerRow, id), H5T_STD_I16LE}})));
  return events_before_.Create(path_, edges.get(), "cd_events_before", Plain(H5T_STD_U64LE));
}

absl::Status Hdf5EventWriter::WriteEvent(const PlainEvent& event) {
  const bool on = event.kind == PlainEvent::kOn;
  if (layout_ == Hdf5EventLayout::kCompound) {
    return cd_.Add(
        {.x = event.x, .y = event.y, .p = static_cast<int16_t>(on ? 1 : 0), .t = event.time_us});
  }
  RIGCAL_RETURN_IF_ERROR(x_.Add(event.x));
  RIGCAL_RETURN_IF_ERROR(y_.Add(event.y));
  RIGCAL_RETURN_IF_ERROR(p_.Add(on ? 1 : 0));
  return t_.Add(event.time_us);
}

absl::Status Hdf5EventWriter::WriteTrigger(const PlainEvent& event) {
  if (layout_ == Hdf5EventLayout::kColumns) {
    ++losses_.triggers;
    return absl::OkStatus();
  }
  const bool rising = event.kind == PlainEvent::kTriggerRising;
  RIGCAL_RETURN_IF_ERROR(events_before_.Add(event_count()));
  return triggers_.Add({.p = static_cast<int16_t>(rising ? 1 : 0),
                        .t = event.time_us,
                        .id = static_cast<int16_t>(event.channel)});
}

absl::Status Hdf5EventWriter::Write(std::span<const PlainEvent> events) {
  const Hdf5Lock lock;
  for (const PlainEvent& event : events) {
    if (event.kind >= PlainEvent::kUnreadable) continue;
    const bool is_trigger = event.kind >= PlainEvent::kTriggerFalling;
    RIGCAL_RETURN_IF_ERROR(is_trigger ? WriteTrigger(event) : WriteEvent(event));
  }
  return absl::OkStatus();
}

absl::Status Hdf5EventWriter::Finish() {
  const Hdf5Lock lock;
  absl::Status status;
  ForEachDataset([&status](auto& dataset) { status.Update(dataset.Flush()); });
  RIGCAL_RETURN_IF_ERROR(status);
  Close();
  const bool flushed = H5Fflush(file_.get(), H5F_SCOPE_GLOBAL) >= 0;
  const std::string reason = flushed ? "" : Hdf5Reason();
  file_.Reset();
  if (flushed) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat("cannot write ", path_, ": ", reason));
}

}  // namespace

absl::StatusOr<std::unique_ptr<PlainEventWriter>> CreateHdf5EventWriter(const std::string& path,
                                                                        const PlainFileFront& front,
                                                                        Hdf5EventLayout layout) {
  const Hdf5Lock lock;
  Hdf5Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) {
    return absl::FailedPreconditionError(absl::StrCat("cannot make ", path, ": ", Hdf5Reason()));
  }
  auto writer = std::make_unique<Hdf5EventWriter>(path, std::move(file), layout);
  RIGCAL_RETURN_IF_ERROR(writer->Begin(front));
  return writer;
}

}  // namespace rigcal::agent
