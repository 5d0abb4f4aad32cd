// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include "common/target/observation.h"

namespace rigcal::server {

// A column whose values are often all the same: then only one is kept.
template <typename T>
class RepeatedColumn {
 public:
  T operator[](size_t i) const { return values_.empty() ? value_ : values_[i]; }
  // The next value; `size` is how many there are.
  void Append(size_t size, T value) {
    if (!known_) value_ = value;
    known_ = true;
    if (values_.empty() && value == value_) return;
    if (values_.empty()) {
      values_.reserve(reserved_);
      values_.assign(size, value_);
    }
    values_.push_back(value);
  }
  // One that nobody will ask for.
  void AppendAny() {
    if (!values_.empty()) values_.push_back(value_);
  }
  void Reserve(size_t size) { reserved_ = size; }
  size_t Bytes() const { return values_.capacity() * sizeof(T); }

 private:
  T value_ = {};
  bool known_ = false;
  size_t reserved_ = 0;
  std::vector<T> values_;
};

// Real numbers, kept as floats as long as every one of them is one: those of an agent all are.
class RealColumn {
 public:
  double operator[](size_t i) const { return wide_.empty() ? double{narrow_[i]} : wide_[i]; }
  void Append(double value) {
    if (wide_.empty() && IsNarrow(value)) {
      narrow_.push_back(static_cast<float>(value));
      return;
    }
    if (wide_.empty()) {
      wide_.assign(narrow_.begin(), narrow_.end());
      narrow_ = std::vector<float>();
    }
    wide_.push_back(value);
  }
  void Reserve(size_t size) { narrow_.reserve(size); }
  size_t Bytes() const {
    return narrow_.capacity() * sizeof(float) + wide_.capacity() * sizeof(double);
  }

 private:
  static bool IsNarrow(double value) {
    return static_cast<double>(static_cast<float>(value)) == value || value != value;
  }
  std::vector<float> narrow_;
  std::vector<double> wide_;
};

// Observations of one camera in columns: a third of the memory of a vector of them. Rows are read
// as copies; values of invisible markers are not kept. Rows with markers have the same number of
// them, filled up with invisible ones.
class ObservationTable {
 public:
  ObservationTable() = default;
  ObservationTable(const std::vector<Observation>& rows);  // NOLINT: the same rows

  size_t size() const { return time_ns_.size(); }
  bool empty() const { return time_ns_.empty(); }
  // Room for so many rows of so many markers each.
  void reserve(size_t rows, size_t markers);
  void push_back(const Observation& row);

  Observation operator[](size_t row) const;
  Observation front() const { return (*this)[0]; }
  Observation back() const { return (*this)[size() - 1]; }
  int64_t time_ns(size_t row) const { return time_ns_[row]; }
  bool AnyVisible(size_t row) const { return VisibleCount(row) > 0; }
  int VisibleCount(size_t row) const {
    int count = 0;
    for (size_t w = row * words(); w < (row + 1) * words(); ++w) {
      count += __builtin_popcount(visible_[w]);
    }
    return count;
  }
  bool IsVisible(size_t row, size_t marker) const {
    return marker < width_ && (visible_[row * words() + marker / 32] >> marker % 32 & 1u) != 0;
  }
  // Markers of a row, visible or not: as many as the target has, or none.
  size_t MarkerCount(size_t row) const { return bare_[row] ? 0 : width_; }

  // Of a visible marker.
  int32_t time_delta_ns(size_t row, size_t marker) const { return delta_ns_[At(row, marker)]; }
  Eigen::Vector2d centre_px(size_t row, size_t marker) const {
    const size_t i = At(row, marker);
    return {x_px_[i], y_px_[i]};
  }
  Eigen::Matrix2d covariance_px2(size_t row, size_t marker) const {
    const size_t i = At(row, marker);
    Eigen::Matrix2d covariance;
    covariance << xx_px2_[i], xy_px2_[i], xy_px2_[i], yy_px2_[i];
    return covariance;
  }
  CentreKind centre_kind(size_t row, size_t marker) const {
    return static_cast<CentreKind>(kind_[At(row, marker)]);
  }
  MarkerObservation Marker(size_t row, size_t marker) const;

  // These rows in this order.
  ObservationTable Select(const std::vector<uint32_t>& rows) const;
  size_t Bytes() const;

  class Iterator {
   public:
    using iterator_category = std::input_iterator_tag;
    using value_type = Observation;
    using difference_type = std::ptrdiff_t;
    using pointer = const Observation*;
    using reference = Observation;

    Iterator(const ObservationTable* table, size_t row) : table_(table), row_(row) {}
    Observation operator*() const { return (*table_)[row_]; }
    Iterator& operator++() {
      ++row_;
      return *this;
    }
    bool operator==(const Iterator& other) const { return row_ == other.row_; }

   private:
    const ObservationTable* table_;
    size_t row_;
  };
  Iterator begin() const { return {this, 0}; }
  Iterator end() const { return {this, size()}; }

 private:
  size_t words() const { return (width_ + 31) / 32; }  // of a row in visible_
  size_t At(size_t row, size_t marker) const { return row * width_ + marker; }
  void AppendMarker(const MarkerObservation& marker);

  size_t width_ = 0;         // markers of a row that has any
  size_t marker_count_ = 0;  // of all rows: their number times the width
  std::vector<int64_t> time_ns_;
  RepeatedColumn<uint32_t> clock_epoch_;
  std::vector<uint32_t> visible_;  // by row, then word; bit m % 32 of word m / 32: marker m
  std::vector<bool> bare_;         // the row has no markers at all
  // By row, then marker.
  RealColumn x_px_, y_px_, xx_px2_, xy_px2_, yy_px2_;
  RepeatedColumn<int32_t> delta_ns_;
  RepeatedColumn<float> confidence_;
  RepeatedColumn<uint8_t> kind_;
};

}  // namespace rigcal::server
