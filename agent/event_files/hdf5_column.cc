// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_column.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

struct KnownFilter {
  H5Z_filter_t id;
  const char* name;
  const char* package;  // where to get it
};
constexpr std::array<KnownFilter, 8> kKnownFilters = {{
    {0x8ECF, "Prophesee's ECF", "hdf5_ecf of Prophesee's SDK (github.com/prophesee-ai/hdf5_ecf)"},
    {32001, "Blosc", "Debian's hdf5-filter-plugin-blosc-serial"},
    {32026, "Blosc2", "the Python package hdf5plugin"},
    {32004, "LZ4", "Debian's hdf5-filter-plugin"},
    {32008, "Bitshuffle", "Debian's hdf5-filter-plugin"},
    {32015, "Zstandard", "the Python package hdf5plugin"},
    {32000, "LZF", "Debian's hdf5-plugin-lzf"},
    {307, "BZip2", "Debian's hdf5-filter-plugin"},
}};

absl::Status MissingFilter(const std::string& where, H5Z_filter_t id, const char* said_name) {
  std::string name = said_name[0] != '\0' ? said_name : "an unknown filter";
  std::string from = "its maker";
  for (const KnownFilter& known : kKnownFilters) {
    if (known.id != id) continue;
    name = known.name;
    from = known.package;
  }
  return InvalidFile(
      where, " is compressed with ", name, " (HDF5 filter ", id,
      "), which is not installed here; install it from ", from,
      " and name its folder in HDF5_PLUGIN_PATH, or where it is installed write the file anew "
      "without it: h5repack -f GZIP=1 IN.h5 OUT.h5");
}

absl::Status CheckFilters(const std::string& where, hid_t creation) {
  const int count = H5Pget_nfilters(creation);
  for (int i = 0; i < count; ++i) {
    unsigned flags = 0, config = 0;
    size_t values = 0;
    std::array<char, 64> name{};
    const H5Z_filter_t id = H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values,
                                           nullptr, name.size() - 1, name.data(), &config);
    if (id >= 0 && H5Zfilter_avail(id) <= 0) return MissingFilter(where, id, name.data());
  }
  return absl::OkStatus();
}

// Of a dataset's chunks when they are in memory; 0: it has none.
size_t ChunkBytes(hid_t creation, hid_t type) {
  if (H5Pget_layout(creation) != H5D_CHUNKED) return 0;
  hsize_t rows = 0;
  if (H5Pget_chunk(creation, 1, &rows) < 1) return 0;
  return static_cast<size_t>(rows) * H5Tget_size(type);
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Hdf5Dataset>> Hdf5Dataset::Open(const std::string& file,
                                                                     hid_t file_id,
                                                                     const std::string& path) {
  auto dataset = std::make_shared<Hdf5Dataset>();
  dataset->file = file;
  dataset->path = path;
  const std::string where = absl::StrCat(file, ": ", path);
  dataset->handle = Hdf5Handle(H5Dopen2(file_id, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset->handle.ok()) {
    return InvalidFile(where, " is no dataset that can be opened: ", Hdf5Reason());
  }
  const Hdf5Handle space(H5Dget_space(dataset->handle.get()), H5Sclose);
  if (const int rank = H5Sget_simple_extent_ndims(space.get()); rank != 1) {
    return InvalidFile(where, " has ", rank,
                       " dimensions, but a column of events has one; write x, y, p and t ",
                       "as datasets of their own");
  }
  hsize_t rows = 0;
  H5Sget_simple_extent_dims(space.get(), &rows, nullptr);
  dataset->row_count = rows;
  dataset->type = Hdf5Handle(H5Dget_type(dataset->handle.get()), H5Tclose);
  const Hdf5Handle creation(H5Dget_create_plist(dataset->handle.get()), H5Pclose);
  RIGCAL_RETURN_IF_ERROR(CheckFilters(where, creation.get()));
  const size_t chunk_bytes = ChunkBytes(creation.get(), dataset->type.get());
  if (chunk_bytes > kMaxChunkBytes) {
    return InvalidFile(where, " is stored in chunks of ", chunk_bytes >> 20, " MB, more than the ",
                       kMaxChunkBytes >> 20,
                       " MB that are held in memory; write the file anew in smaller ones: ",
                       "h5repack -l CHUNK=65536 IN.h5 OUT.h5");
  }
  if (chunk_bytes > 0) {
    // A chunk that does not fit into its cache is read and unpacked again for every block of it.
    const Hdf5Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
    constexpr size_t kSlots = 521;
    constexpr size_t kDefaultBytes = size_t{1} << 20;
    H5Pset_chunk_cache(access.get(), kSlots, std::max(kDefaultBytes, chunk_bytes), 1.0);
    dataset->handle.Reset();
    dataset->handle = Hdf5Handle(H5Dopen2(file_id, path.c_str(), access.get()), H5Dclose);
  }
  return dataset;
}

absl::Status Hdf5Dataset::Read(uint64_t first, size_t count, hid_t memory_type,
                               void* values) const {
  if (count == 0) return absl::OkStatus();
  const hsize_t start = first, size = count;
  const Hdf5Handle from(H5Dget_space(handle.get()), H5Sclose);
  const Hdf5Handle to(H5Screate_simple(1, &size, nullptr), H5Sclose);
  if (H5Sselect_hyperslab(from.get(), H5S_SELECT_SET, &start, nullptr, &size, nullptr) < 0 ||
      H5Dread(handle.get(), memory_type, to.get(), from.get(), H5P_DEFAULT, values) < 0) {
    return absl::DataLossError(absl::StrCat(file, ": rows ", first, " to ", first + count - 1,
                                            " of ", path, " cannot be read: ", Hdf5Reason(),
                                            "; is the file whole?"));
  }
  return absl::OkStatus();
}

absl::StatusOr<Hdf5Column> Hdf5Column::Create(std::shared_ptr<const Hdf5Dataset> dataset,
                                              const std::string& member) {
  Hdf5Column column;
  column.dataset_ = std::move(dataset);
  column.member_ = member;
  const hid_t row_type = column.dataset_->type.get();
  if (member.empty()) {
    column.type_ = Hdf5Handle(H5Tcopy(row_type), H5Tclose);
  } else {
    const int index =
        H5Tget_class(row_type) == H5T_COMPOUND ? H5Tget_member_index(row_type, member.c_str()) : -1;
    if (index < 0) {
      return InvalidFile(
          column.dataset_->file, ": ", column.dataset_->path, " has no member ", member,
          "; events are compound, with members x, y, p and t (triggers: p, t and id)");
    }
    column.type_ = Hdf5Handle(H5Tget_member_type(row_type, static_cast<unsigned>(index)), H5Tclose);
  }
  const H5T_class_t kind = H5Tget_class(column.type_.get());
  if (kind == H5T_ENUM || kind == H5T_INTEGER || kind == H5T_FLOAT) return column;
  return InvalidFile(column.dataset_->file, ": ", column.Name(), " is not of numbers");
}

std::string Hdf5Column::Name() const {
  return member_.empty() ? dataset_->path : absl::StrCat(member_, " of ", dataset_->path);
}

absl::Status Hdf5Column::RequireWhole() const {
  if (!is_float()) return absl::OkStatus();
  return InvalidFile(dataset_->file, ": ", Name(),
                     " is of floating-point numbers, but x, y and p of an event are whole ones; ",
                     "write the events as the sensor told them, not undistorted");
}

absl::Status Hdf5Column::ReadAs(hid_t type, uint64_t first, size_t count, void* values) const {
  if (member_.empty()) return dataset_->Read(first, count, type, values);
  const Hdf5Handle row(H5Tcreate(H5T_COMPOUND, H5Tget_size(type)), H5Tclose);
  H5Tinsert(row.get(), member_.c_str(), 0, type);
  return dataset_->Read(first, count, row.get(), values);
}

}  // namespace rigcal::agent
