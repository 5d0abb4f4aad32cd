// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "common/camera/camera_description.h"
#include "common/geometry/rigid_transform.h"
#include "common/target/target.h"
#include "rigcal/v1/camera.pb.h"
#include "rigcal/v1/geometry.pb.h"
#include "rigcal/v1/target.pb.h"

namespace rigcal::wire {

// FromProto validates: INVALID_ARGUMENT names the field's path within the message.
v1::CameraDescription ToProto(const CameraDescription& camera);
absl::StatusOr<CameraDescription> FromProto(const v1::CameraDescription& proto);
v1::CameraSettings ToProto(const CameraSettings& settings);
CameraSettings FromProto(const v1::CameraSettings& proto);
v1::Intrinsics ToProto(const Intrinsics& intrinsics);
absl::StatusOr<Intrinsics> FromProto(const v1::Intrinsics& proto);
v1::ImageSize ToProto(const ImageSize& size);
ImageSize FromProto(const v1::ImageSize& proto);
v1::Vector3 ToProto(const Eigen::Vector3d& vector);
Eigen::Vector3d FromProto(const v1::Vector3& proto);
v1::RigidTransform ToProto(const RigidTransform& transform);
absl::StatusOr<RigidTransform> FromProto(const v1::RigidTransform& proto);
v1::Target ToProto(const Target& target);
absl::StatusOr<Target> FromProto(const v1::Target& proto);

}  // namespace rigcal::wire
