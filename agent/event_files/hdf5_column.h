// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/event_files/hdf5_handle.h"

namespace rigcal::agent {

// A one-dimensional dataset that was looked at: its filters are installed and its chunks fit into
// memory. Hold an Hdf5Lock around every call and the end.
struct Hdf5Dataset {
  std::string file;  // for messages
  std::string path;  // "/events/x"
  Hdf5Handle handle;
  Hdf5Handle type;
  uint64_t row_count = 0;

  // INVALID_ARGUMENT: no dataset of one dimension, a filter that is missing, chunks of more than
  // kMaxChunkBytes. Names the file, the dataset and what to do.
  static absl::StatusOr<std::shared_ptr<const Hdf5Dataset>> Open(const std::string& file,
                                                                 hid_t file_id,
                                                                 const std::string& path);
  static constexpr size_t kMaxChunkBytes = size_t{128} << 20;

  // Rows [first, first + count) into `values`, converted to `memory_type`. DATA_LOSS.
  absl::Status Read(uint64_t first, size_t count, hid_t memory_type, void* values) const;
};

// One number in each row: all of a dataset, or a member of a compound one.
class Hdf5Column {
 public:
  Hdf5Column() = default;
  // INVALID_ARGUMENT: no such member, or a type that is no number.
  static absl::StatusOr<Hdf5Column> Create(std::shared_ptr<const Hdf5Dataset> dataset,
                                           const std::string& member);

  const Hdf5Dataset& dataset() const { return *dataset_; }
  std::string Name() const;  // "/events/x", "x of /CD/events"
  bool is_float() const { return H5Tget_class(type_.get()) == H5T_FLOAT; }
  bool Is(hid_t type) const { return H5Tequal(type_.get(), type) > 0; }
  // INVALID_ARGUMENT, unless it is of whole numbers (bool is).
  absl::Status RequireWhole() const;

  // Replaces `values` (int32_t, int64_t or double). A number that does not fit becomes the nearest
  // that does. DATA_LOSS.
  template <typename Value>
  absl::Status Read(uint64_t first, size_t count, std::vector<Value>* values) const {
    values->resize(count);
    const hid_t type = std::is_floating_point_v<Value> ? H5T_NATIVE_DOUBLE
                       : sizeof(Value) == 4            ? H5T_NATIVE_INT32
                                                       : H5T_NATIVE_INT64;
    return ReadAs(type, first, count, values->data());
  }

 private:
  absl::Status ReadAs(hid_t type, uint64_t first, size_t count, void* values) const;

  std::shared_ptr<const Hdf5Dataset> dataset_;
  std::string member_;  // empty: the dataset is the column
  Hdf5Handle type_;     // of the numbers in the file
};

}  // namespace rigcal::agent
