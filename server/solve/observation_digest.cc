// SPDX-License-Identifier: Apache-2.0
#include "server/solve/observation_digest.h"

#include <openssl/evp.h>

#include <array>
#include <bit>
#include <cstdint>
#include <memory>

#include "absl/strings/escaping.h"

namespace rigcal::server {
namespace {

// Feeds values to the digest in one byte order, strings with their length.
class Hasher {
 public:
  Hasher() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  void Add(uint64_t value) {
    std::array<unsigned char, 8> bytes;
    for (size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<unsigned char>(value >> (8 * i));
    }
    EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size());
  }
  void Add(int64_t value) { Add(static_cast<uint64_t>(value)); }
  void Add(double value) { Add(std::bit_cast<uint64_t>(value)); }
  void Add(const std::string& text) {
    Add(static_cast<uint64_t>(text.size()));
    EVP_DigestUpdate(context_.get(), text.data(), text.size());
  }
  void Add(const std::vector<double>& values) {
    Add(static_cast<uint64_t>(values.size()));
    for (const double value : values) Add(value);
  }
  std::string Hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    return absl::BytesToHexString(
        absl::string_view(reinterpret_cast<const char*>(digest.data()), size));
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

void AddObservation(const Observation& observation, Hasher* hasher) {
  hasher->Add(observation.time_ns);
  hasher->Add(static_cast<uint64_t>(observation.markers.size()));
  for (const MarkerObservation& marker : observation.markers) {
    hasher->Add(static_cast<uint64_t>(marker.visible ? 1 : 0));
    if (!marker.visible) continue;
    for (const double value :
         {marker.centre_px.x(), marker.centre_px.y(), marker.covariance_px2(0, 0),
          marker.covariance_px2(0, 1), marker.covariance_px2(1, 1)}) {
      hasher->Add(value);
    }
    hasher->Add(static_cast<int64_t>(marker.time_delta_ns));
    hasher->Add(static_cast<double>(marker.label_confidence));
    hasher->Add(static_cast<uint64_t>(marker.centre_kind));
  }
}

void AddCamera(const CameraDescription& camera, Hasher* hasher) {
  hasher->Add(camera.camera);
  hasher->Add(camera.clock.clock_id);
  hasher->Add(camera.clock.timebase);
  hasher->Add(camera.latency_s);
  hasher->Add(static_cast<uint64_t>(camera.image_size_px.width));
  hasher->Add(static_cast<uint64_t>(camera.image_size_px.height));
  if (!camera.intrinsics) return;
  const Intrinsics& intrinsics = *camera.intrinsics;
  hasher->Add(static_cast<uint64_t>(intrinsics.model));
  hasher->Add(
      std::vector<double>{intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px, intrinsics.cy_px});
  hasher->Add(intrinsics.distortion);
}

}  // namespace

std::string ObservationDigest(const CalibrationOptions& options, const Target& target,
                              const std::vector<AlignedTrack>& tracks,
                              const std::vector<std::vector<bool>>& used) {
  Hasher hasher;
  hasher.Add(options.reference_camera);
  for (const Estimate estimate :
       {options.intrinsics, options.time_offsets, options.marker_positions}) {
    hasher.Add(static_cast<uint64_t>(estimate));
  }
  hasher.Add(options.sigma_px);
  hasher.Add(options.association_tolerance_s);
  hasher.Add(static_cast<uint64_t>(options.seed));
  if (options.known_distance) {
    hasher.Add(options.known_distance->camera_a);
    hasher.Add(options.known_distance->camera_b);
    hasher.Add(options.known_distance->distance_m);
    hasher.Add(options.known_distance->SigmaM());
  }
  hasher.Add(static_cast<uint64_t>(target.kind));
  hasher.Add(target.marker_positions_m);
  hasher.Add(target.diameter_m);
  hasher.Add(target.blink_hz);
  hasher.Add(target.span_tolerance_m);
  // Sessions by their place, not their id: the same observations in another session are the same.
  uint64_t session = 0;
  for (size_t t = 0; t < tracks.size(); ++t) {
    const CleanTrack& track = tracks[t].track;
    if (t > 0 && track.session_id != tracks[t - 1].track.session_id) ++session;
    hasher.Add(session);
    AddCamera(track.camera, &hasher);
    hasher.Add(static_cast<uint64_t>(track.clock_epoch));
    hasher.Add(tracks[t].clock_offset_ns);
    for (size_t i = 0; i < track.observations.size(); ++i) {
      if (used[t][i]) AddObservation(track.observations[i], &hasher);
    }
  }
  return hasher.Hex();
}

}  // namespace rigcal::server
