// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "agent/capture/observation_source.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

// One camera's source as a user describes it: options that have been read, nothing opened.
class SourceSpec {
 public:
  virtual ~SourceSpec() = default;
  // The camera's name within the rig. Once resolved.
  virtual const std::string& camera() const = 0;
  // Every option of the source and its detector. They are set in this object, which outlives the
  // table.
  virtual void AddTo(OptionTable* table) = 0;
  // Once the options are read: fills in what follows from the name (empty: none was given) and the
  // subject. INVALID_ARGUMENT with every fault.
  virtual absl::Status Resolve(const std::string& name, const std::string& subject) = 0;
  // The source itself; opens its files once to see that they are there. The message names the
  // camera, the file and what to do.
  virtual absl::StatusOr<std::unique_ptr<ObservationSource>> Create() const = 0;

 protected:
  // Of the source's detector, if it has one.
  void AddDetector(OptionTable*) {}
  absl::Status CheckDetector() const { return absl::OkStatus(); }
};

// A kind of source: all that help, documentation and parser know of it.
struct SourceKind {
  std::string_view name;           // "csv": what a SPEC begins with, without the colon
  std::string_view selector = {};  // "pixels": the option by which this kind is chosen among kinds
                                   // of one name; empty: none
  std::string_view subject = {};   // "PATH": what follows the colon; empty: options only
  bool subject_is_path = false;    // relative to the folder of a configuration file
  std::string_view required = {};  // "camera": an option that must be given; empty: none
  std::string_view summary;        // "marker centres from a CSV file"
  std::string_view example;        // a whole SPEC
  std::unique_ptr<SourceSpec> (*make)();
};

// A source that yields observations itself.
class DirectSourceSpec : public SourceSpec {
 public:
  using Product = ObservationSource;
  virtual absl::StatusOr<std::unique_ptr<Product>> Make() const = 0;
  absl::StatusOr<std::unique_ptr<ObservationSource>> Create() const final { return Make(); }
};

template <typename Options>
struct HasOptions {
  Options options;
};

// The spec of `Source`, which has Create(Options). Options has a `camera`, Validate() and, found by
// their arguments, AddOptions(Options*, OptionTable*) and
// ResolveOptions(name, subject, Options*). `Base` is DirectSourceSpec, FrameSourceSpec or
// EventSourceSpec.
template <typename Base, typename Source, typename Options>
class SpecOf : public Base, public HasOptions<Options> {
 public:
  const std::string& camera() const override { return this->options.camera; }
  void AddTo(OptionTable* table) override {
    AddOptions(&this->options, table);
    this->AddDetector(table);
  }
  absl::Status Resolve(const std::string& name, const std::string& subject) override {
    ResolveOptions(name, subject, &this->options);
    if (absl::Status status = this->options.Validate(); !status.ok()) return status;
    return this->CheckDetector();
  }
  absl::StatusOr<std::unique_ptr<typename Base::Product>> Make() const override {
    return Source::Create(this->options);
  }
};

template <typename Spec>
std::unique_ptr<SourceSpec> MakeSpec() {
  return std::make_unique<Spec>();
}

// The options that several kinds share.

// "speed": times the recorded pace; kMaxSpeed for "max".
void AddSpeed(double* speed, OptionTable* table);
// "calibration": the camera's OpenCV YAML, or "none".
void AddCalibration(std::string* path, OptionTable* table);
// Clears "none"; where nothing was given, the subject with the ending .yaml, or nothing if that is
// empty.
void ResolveCalibration(const std::string& subject, std::string* path);
// The name given, or the stem of the path: "left" of "rig/left.csv" and "rig/left/".
std::string CameraNameOf(const std::string& name, const std::string& path);

}  // namespace rigcal::agent
