// SPDX-License-Identifier: Apache-2.0
#include "server/solve/observation_digest.h"

#include <openssl/evp.h>

#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "absl/strings/escaping.h"

namespace rigcal::server {
namespace {

// Feeds values to the digest in one byte order, strings with their length.
class Hasher {
 public:
  Hasher() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  template <typename... Values>
  void Add(const Values&... values) {
    (AddOne(values), ...);
  }
  std::string Hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    return absl::BytesToHexString(
        absl::string_view(reinterpret_cast<const char*>(digest.data()), size));
  }

 private:
  template <typename T>
  void AddOne(const T& value) {
    if constexpr (std::is_same_v<T, std::string>) {
      AddOne(value.size());
      EVP_DigestUpdate(context_.get(), value.data(), value.size());
    } else if constexpr (std::is_same_v<T, std::vector<double>>) {
      AddOne(value.size());
      for (const double number : value) AddOne(number);
    } else if constexpr (std::is_floating_point_v<T>) {
      AddOne(std::bit_cast<uint64_t>(static_cast<double>(value)));
    } else {
      std::array<unsigned char, 8> bytes;
      for (size_t i = 0; i < bytes.size(); ++i) {
        bytes[i] = static_cast<unsigned char>(static_cast<uint64_t>(value) >> (8 * i));
      }
      EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size());
    }
  }

  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

void AddObservation(const Observation& observation, Hasher* hasher) {
  hasher->Add(observation.time_ns, observation.markers.size());
  for (const MarkerObservation& marker : observation.markers) {
    hasher->Add(marker.visible);
    if (!marker.visible) continue;
    hasher->Add(marker.centre_px.x(), marker.centre_px.y(), marker.covariance_px2(0, 0),
                marker.covariance_px2(0, 1), marker.covariance_px2(1, 1), marker.time_delta_ns,
                marker.label_confidence, marker.centre_kind);
  }
}

void AddCamera(const CameraDescription& camera, Hasher* hasher) {
  hasher->Add(camera.camera, camera.clock.clock_id, camera.clock.timebase, camera.latency_s,
              camera.image_size_px.width, camera.image_size_px.height);
  if (!camera.intrinsics) return;
  const Intrinsics& given = *camera.intrinsics;
  hasher->Add(given.model, std::vector<double>{given.fx_px, given.fy_px, given.cx_px, given.cy_px},
              given.distortion);
}

void AddTarget(const Target& target, Hasher* hasher) {
  hasher->Add(target.kind, target.marker_positions_m, target.diameter_m, target.blink_hz,
              target.span_tolerance_m);
  for (const TargetPoint& point : target.points) {
    hasher->Add(point.label, point.x_m, point.y_m, point.z_m, point.sigma_m);
  }
}

}  // namespace

std::string ObservationDigest(const CalibrationOptions& options, const TargetParts& targets,
                              const std::vector<AlignedTrack>& tracks,
                              const std::vector<std::vector<bool>>& used) {
  Hasher hasher;
  hasher.Add(options.reference_camera, options.intrinsics, options.time_offsets,
             options.marker_positions, options.sigma_px, options.association_tolerance_s,
             options.seed);
  if (options.trajectory != TrajectoryChoice::kAuto) hasher.Add(options.trajectory);
  if (options.known_distance) {
    const KnownDistance& known = *options.known_distance;
    hasher.Add(known.camera_a, known.camera_b, known.distance_m, known.SigmaM());
  }
  if (options.kind != SolveKind::kFull) {
    hasher.Add(options.kind, options.parent_id, options.only_cameras.size());
    for (const std::string& camera : options.only_cameras) hasher.Add(camera);
  }
  if (options.kind == SolveKind::kFull && options.NeedsParent()) {
    hasher.Add(options.frame, options.parent_id);
  }
  for (const std::string& camera : options.fixed_intrinsics) hasher.Add(camera);
  AddTarget(targets.first(), &hasher);
  // Sessions by their place, not their id: the same observations in another session are the same.
  uint64_t session = 0;
  for (size_t t = 0; t < tracks.size(); ++t) {
    const CleanTrack& track = tracks[t].track;
    if (t > 0 && track.session_id != tracks[t - 1].track.session_id) ++session;
    if (targets.is_mixed()) AddTarget(targets.Of(track.session_id).target, &hasher);
    hasher.Add(session);
    AddCamera(track.camera, &hasher);
    hasher.Add(track.clock_epoch, tracks[t].clock_offset_ns);
    for (size_t i = 0; i < track.observations.size(); ++i) {
      if (used[t][i]) AddObservation(track.observations[i], &hasher);
    }
  }
  return hasher.Hex();
}

std::string DerivedDigest(const std::string& parent_digest, const CalibrationOptions& options,
                          const std::vector<MarkerViews>& measured) {
  Hasher hasher;
  hasher.Add(parent_digest, options.kind, options.parent_id, options.sigma_px,
             options.association_tolerance_s);
  if (options.origin) {
    const OriginRequest& origin = *options.origin;
    hasher.Add(origin.source, origin.height_m, origin.still_s, origin.max_residual_m,
               origin.max_rotation_sigma_rad, origin.cameras_below);
    for (const TargetPoint& point : origin.points) {
      hasher.Add(point.label, point.x_m, point.y_m, point.z_m, point.sigma_m);
    }
    for (const double value : origin.down) hasher.Add(value);
    for (const double value : origin.translation_m) hasher.Add(value);
    for (const double value : origin.rotation_wxyz) hasher.Add(value);
  }
  if (options.scale) {
    for (const CameraDistance& distance : options.scale->distances) {
      hasher.Add(distance.camera_a, distance.camera_b, distance.distance_m, distance.SigmaM());
    }
    for (const KnownLength& length : options.scale->lengths) {
      hasher.Add(length.marker_a, length.marker_b, length.length_m, length.SigmaM());
    }
    for (const std::string& name : options.scale->leave_out) hasher.Add(name);
  }
  for (const MarkerViews& marker : measured) {
    hasher.Add(marker.marker, marker.place, marker.rig_time_ns, marker.views.size());
    for (const MarkerView& view : marker.views) {
      hasher.Add(view.camera, view.x_px, view.y_px, view.xx_px2, view.xy_px2, view.yy_px2);
    }
  }
  return hasher.Hex();
}

}  // namespace rigcal::server
