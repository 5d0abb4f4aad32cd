// SPDX-License-Identifier: Apache-2.0
#include "server/worker/solve_input.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "server/worker/message_reader.h"

namespace rigcal::server {
namespace {

// A header may claim any number of rows; no more are reserved than this much input could hold.
constexpr uint64_t kMaxReservedRows = uint64_t{1} << 31;

absl::Status CutOff(absl::string_view what) {
  return absl::DataLossError(absl::StrCat("the input of the solve is damaged: ", what));
}

// Puts the parts of an input together.
class InputBuilder {
 public:
  bool complete() const { return ended_; }

  absl::Status Add(const worker::v1::SolveInput& message) {
    if (ended_) return CutOff("something follows its end");
    switch (message.part_case()) {
      case worker::v1::SolveInput::kHeader:
        return Begin(message.header());
      case worker::v1::SolveInput::kRows:
        return AddRows(message.rows());
      case worker::v1::SolveInput::kEnd:
        for (const auto& refusal : message.end().refused()) {
          result_.input.refused.push_back(wire::FromProto(refusal));
        }
        ended_ = true;
        return absl::OkStatus();
      default:
        return CutOff("a part of an unknown kind");
    }
  }

  SolveInput Take() { return std::move(result_); }

 private:
  absl::Status Begin(const worker::v1::SolveHeader& header) {
    RIGCAL_ASSIGN_OR_RETURN(result_.input.target, wire::FromProto(header.target()));
    for (const auto& [session_id, other] : header.other_targets()) {
      RIGCAL_ASSIGN_OR_RETURN(result_.input.other_targets[session_id], wire::FromProto(other));
    }
    RIGCAL_ASSIGN_OR_RETURN(result_.options, wire::FromProto(header.options()));
    if (!header.parent().empty()) {
      RIGCAL_ASSIGN_OR_RETURN(Calibration parent, wire::ParseCalibration(header.parent()));
      result_.input.parent = std::move(parent.result);
    }
    for (const worker::v1::SolveTrack& proto : header.tracks()) {
      CameraTrack track;
      track.session_id = proto.session_id();
      RIGCAL_ASSIGN_OR_RETURN(track.camera, wire::FromProto(proto.camera()));
      track.observations.reserve(
          static_cast<size_t>(std::min<uint64_t>(proto.row_limit(), kMaxReservedRows)));
      result_.input.tracks.push_back(std::move(track));
    }
    return absl::OkStatus();
  }

  absl::Status AddRows(const worker::v1::SolveRows& rows) {
    if (rows.track() >= result_.input.tracks.size()) return CutOff("rows of no camera");
    RIGCAL_ASSIGN_OR_RETURN(const ObservationBatch batch, wire::FromProto(rows.batch()));
    server::AddRows(batch, &result_.input.tracks[rows.track()]);
    return absl::OkStatus();
  }

  SolveInput result_;
  bool ended_ = false;
};

}  // namespace

absl::Status SolveInputWriter::Begin(const Target& target, const CalibrationOptions& options,
                                     const std::vector<CameraTrack>& tracks,
                                     const std::vector<uint64_t>& row_limits,
                                     const std::map<std::string, Target>& other_targets,
                                     const Calibration* parent) {
  worker::v1::SolveHeader* const header = message_.mutable_header();
  *header->mutable_target() = wire::ToProto(target);
  for (const auto& [session_id, other] : other_targets) {
    (*header->mutable_other_targets())[session_id] = wire::ToProto(other);
  }
  *header->mutable_options() = wire::ToProto(options);
  if (parent != nullptr) header->set_parent(wire::SerializeCalibration(*parent));
  for (size_t t = 0; t < tracks.size(); ++t) {
    worker::v1::SolveTrack* const track = header->add_tracks();
    track->set_session_id(tracks[t].session_id);
    *track->mutable_camera() = wire::ToProto(tracks[t].camera);
    track->set_row_limit(row_limits[t]);
  }
  return writer_.Write(message_);
}

absl::Status SolveInputWriter::AddRows(size_t track, const ObservationBatch& batch) {
  message_.mutable_rows()->set_track(static_cast<uint32_t>(track));
  wire::ToProto(batch, message_.mutable_rows()->mutable_batch());
  return writer_.Write(message_);
}

absl::Status SolveInputWriter::End(const std::vector<Refusal>& refused) {
  message_.mutable_end();
  for (const Refusal& refusal : refused) {
    *message_.mutable_end()->add_refused() = wire::ToProto(refusal);
  }
  RIGCAL_RETURN_IF_ERROR(writer_.Write(message_));
  return writer_.Flush();
}

absl::StatusOr<SolveInput> ReadSolveInput(int descriptor) {
  InputBuilder builder;
  worker::v1::SolveInput message;
  RIGCAL_RETURN_IF_ERROR(ReadMessages(descriptor, &message, [&] { return builder.Add(message); }));
  if (!builder.complete()) return CutOff("it ends too early");
  return builder.Take();
}

}  // namespace rigcal::server
