// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
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
  bool is_float() const { return is_float_; }
  size_t byte_count() const { return byte_count_; }  // of a number in the file
  bool is_signed() const { return is_signed_; }
  // INVALID_ARGUMENT, unless it is of whole numbers (bool is).
  absl::Status RequireWhole() const;

  // A number that does not fit becomes the nearest that does. DATA_LOSS.
  absl::Status Read(uint64_t first, size_t count, std::vector<int32_t>* values) const;
  absl::Status Read(uint64_t first, size_t count, std::vector<int64_t>* values) const;
  absl::Status Read(uint64_t first, size_t count, std::vector<double>* values) const;

 private:
  template <typename Value>
  absl::Status ReadAs(hid_t type, uint64_t first, size_t count, std::vector<Value>* values) const;

  std::shared_ptr<const Hdf5Dataset> dataset_;
  std::string member_;  // empty: the dataset is the column
  bool is_float_ = false;
  bool is_signed_ = false;
  size_t byte_count_ = 0;
};

}  // namespace rigcal::agent
