// SPDX-License-Identifier: Apache-2.0
#include "common/import/double_sphere.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/camera/camera_model.h"
#include "common/import/fitted_lens.h"
#include "common/import/import_readers.h"
#include "common/import/intrinsics_file.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::double_sphere_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr ImageSize kSize{752, 480};
// 122 degrees from corner to corner.
constexpr DoubleSphere kWide{
    .xi = -0.18, .alpha = 0.59, .fx_px = 330, .fy_px = 329.5, .cx_px = 371.5, .cy_px = 243.25};
// 57 degrees from corner to corner.
constexpr DoubleSphere kNormal{
    .xi = 0.05, .alpha = 0.5, .fx_px = 900, .fy_px = 901, .cx_px = 380, .cy_px = 236};
// The corners look more than 90 degrees away from the axis.
constexpr DoubleSphere kWholeSky{
    .xi = -0.27, .alpha = 0.57, .fx_px = 157, .fy_px = 157, .cx_px = 255.5, .cy_px = 255.5};

// Section 3.3 of the paper, equations 40 to 42: the other way round than DoubleSphere::Ray.
Eigen::Vector2d ProjectByDoubleSphere(const DoubleSphere& lens, const Eigen::Vector3d& x) {
  const double d1 = x.norm();
  const double shifted = lens.xi * d1 + x.z();
  const double d2 = std::hypot(x.x(), x.y(), shifted);
  const double below = lens.alpha * d2 + (1 - lens.alpha) * shifted;
  return {lens.fx_px * x.x() / below + lens.cx_px, lens.fy_px * x.y() / below + lens.cy_px};
}

std::string KalibrText(const DoubleSphere& lens, const ImageSize& size) {
  return absl::StrCat("cam0:\n  camera_model: ds\n  distortion_coeffs: []\n",
                      "  distortion_model: none\n  intrinsics: [", lens.xi, ", ", lens.alpha, ", ",
                      lens.fx_px, ", ", lens.fy_px, ", ", lens.cx_px, ", ", lens.cy_px,
                      "]\n  resolution: [", size.width, ", ", size.height,
                      "]\n  rostopic: /left/image_raw\n");
}

std::string BasaltText(const DoubleSphere& lens, const ImageSize& size) {
  return absl::StrCat(
      "{\"value0\": {\"T_imu_cam\": [{\"px\": 0.5, \"py\": 0, \"pz\": 0, \"qx\": 0, \"qy\": 0, ",
      "\"qz\": 0.6, \"qw\": 0.8}], \"intrinsics\": [{\"camera_type\": \"ds\", \"intrinsics\": ",
      "{\"fx\": ", lens.fx_px, ", \"fy\": ", lens.fy_px, ", \"cx\": ", lens.cx_px,
      ", \"cy\": ", lens.cy_px, ", \"xi\": ", lens.xi, ", \"alpha\": ", lens.alpha,
      "}}], \"resolution\": [[", size.width, ", ", size.height,
      "]], \"cam_time_offset_ns\": 2000000}}");
}

// The largest distance between the two over the image, by directions, not by pixels of a grid.
double LargestDifferencePx(const DoubleSphere& lens, const Intrinsics& read,
                           const ImageSize& size) {
  double largest_px = 0;
  int count = 0;
  for (double x = -3; x <= 3; x += 0.05) {
    for (double y = -3; y <= 3; y += 0.05) {
      const Eigen::Vector3d direction(x, y, 1);
      const Eigen::Vector2d pixel = ProjectByDoubleSphere(lens, direction);
      if (pixel.x() < -0.5 || pixel.y() < -0.5 || pixel.x() > size.width - 0.5 ||
          pixel.y() > size.height - 0.5) {
        continue;
      }
      Eigen::Vector2d seen(1e9, 1e9);
      Project(read, direction, &seen);
      largest_px = std::max(largest_px, (seen - pixel).norm());
      ++count;
    }
  }
  EXPECT_GT(count, 100);
  return largest_px;
}

TEST(DoubleSphere, RaysAreTheInverseOfItsProjection) {
  for (const DoubleSphere& lens : {kWide, kNormal, kWholeSky}) {
    for (double theta = 0; theta < 1.7; theta += 0.1) {
      const Eigen::Vector3d x(std::sin(theta) * 0.6, std::sin(theta) * -0.8, std::cos(theta));
      const auto ray = lens.Ray(ProjectByDoubleSphere(lens, x));
      ASSERT_TRUE(ray.has_value());
      EXPECT_LT((ray->normalized() - x).norm(), 1e-9) << theta;
    }
  }
  // 1 / (2 alpha - 1) of r^2 is the circle's.
  const double radius_px = kWholeSky.fx_px / std::sqrt(2 * kWholeSky.alpha - 1);
  EXPECT_TRUE(kWholeSky.Ray({kWholeSky.cx_px + 0.999 * radius_px, kWholeSky.cy_px}).has_value());
  EXPECT_FALSE(kWholeSky.Ray({kWholeSky.cx_px + 1.001 * radius_px, kWholeSky.cy_px}).has_value());
}

TEST(DoubleSphere, OfKalibrIsReadAsTheNearestLens) {
  for (const DoubleSphere& lens : {kWide, kNormal}) {
    ASSERT_OK_AND_ASSIGN(const ImportedRig rig,
                         ReadKalibr("camchain.yaml", KalibrText(lens, kSize)));
    ASSERT_THAT(rig.cameras, SizeIs(1));
    EXPECT_EQ(rig.cameras[0].name, "left");
    EXPECT_LT(LargestDifferencePx(lens, rig.cameras[0].intrinsics, kSize), kDoubleSphereWithinPx);
    ASSERT_THAT(rig.notes, SizeIs(1));
    EXPECT_THAT(rig.notes[0], AllOf(HasSubstr("cam0: its double sphere lens is read as"),
                                    HasSubstr("they differ by at most ")));
  }
}

TEST(DoubleSphere, OfBasaltIsReadWithPoseAndClock) {
  const TemporaryDirectory directory;
  const auto path = directory.WriteFile("calibration.json", BasaltText(kWide, kSize));
  ASSERT_OK_AND_ASSIGN(const ImportedRig rig, ReadCalibrationFile(path.string()));
  EXPECT_EQ(rig.format, "Basalt");
  ASSERT_THAT(rig.cameras, SizeIs(1));
  const ImportedCamera& camera = rig.cameras[0];
  EXPECT_LT(LargestDifferencePx(kWide, camera.intrinsics, kSize), kDoubleSphereWithinPx);
  EXPECT_EQ(camera.image_size_px, kSize);
  EXPECT_DOUBLE_EQ(camera.time_offset_s, 0.002);
  // The camera is at (0.5, 0, 0) of the IMU's frame, turned about z: x of the camera is (0.28,
  // 0.96, 0) there.
  EXPECT_LT((*camera.cam_from_rig * Eigen::Vector3d(0.5, 0, 0)).norm(), 1e-12);
  EXPECT_LT(
      (*camera.cam_from_rig * Eigen::Vector3d(0.78, 0.96, 0) - Eigen::Vector3d(1, 0, 0)).norm(),
      1e-12);
  ASSERT_THAT(rig.notes, SizeIs(1));
  // As an agent reads the same file.
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file, ReadIntrinsicsFile(path.string()));
  EXPECT_EQ(file.intrinsics, camera.intrinsics);
}

TEST(DoubleSphere, OtherLensesOfBasaltAreReadAsTheyAre) {
  const std::string values = "\"fx\": 400, \"fy\": 401, \"cx\": 320, \"cy\": 240";
  const auto text = [&](const std::string& type, const std::string& more) {
    return "{\"value0\": {\"intrinsics\": [{\"camera_type\": \"" + type + "\", \"intrinsics\": {" +
           values + more + "}}], \"resolution\": [[640, 480]]}}";
  };
  ASSERT_OK_AND_ASSIGN(
      const ImportedRig fisheye,
      ReadBasalt("c.json", text("kb4", ", \"k1\": 0.1, \"k2\": 0.2, \"k3\": 0.3, \"k4\": 0.4")));
  EXPECT_EQ(fisheye.cameras[0].intrinsics.model, DistortionModel::kFisheye);
  EXPECT_EQ(fisheye.cameras[0].intrinsics.distortion, (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
  EXPECT_THAT(fisheye.notes, SizeIs(0));
  ASSERT_OK_AND_ASSIGN(const ImportedRig pinhole, ReadBasalt("c.json", text("pinhole", "")));
  EXPECT_EQ(pinhole.cameras[0].intrinsics.fy_px, 401);
  EXPECT_THAT(ReadBasalt("c.json", text("kb4", ", \"k1\": 0.1")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("c.json"), HasSubstr("cam0"), HasSubstr("number k2"))));
  EXPECT_THAT(ReadBasalt("c.json", text("eucm", ", \"alpha\": 0.5, \"beta\": 1")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera_type eucm"), HasSubstr("EUCM"))));
}

struct BadLens {
  const char* what;
  const char* from;  // replaced in a good text
  const char* to;
  const char* says;
};

std::string FaultOf(const absl::StatusOr<ImportedRig>& rig) {
  return std::string(rig.status().message());
}

TEST(DoubleSphere, FaultsOfKalibrsFilesAreNamedWithTheirLine) {
  const std::string good = KalibrText(kWide, kSize);
  const BadLens faults[] = {
      {"not a number", "[-0.18", "[.nan", "line 5: cam0 intrinsics has an element"},
      {"alpha too large", ", 0.59", ", 1.01", "line 5: cam0 has a double sphere lens"},
      {"alpha negative", ", 0.59", ", -0.1", "alpha is -0.1, it must be 0 to 1"},
      {"xi", "[-0.18", "[-1.5", "xi is -1.5"},
      {"focal length", ", 330,", ", 0,", "the focal lengths are 0"},
      {"a value is missing", ", 243.25]", "]",
       "line 5: cam0 intrinsics is not a list of 6 numbers"},
      {"distortion as well", "coeffs: []", "coeffs: [0.1, 0, 0, 0]",
       "line 3: cam0 has distortion_c"},
      {"radtan as well", "model: none", "model: radtan", "distortion_model radtan beside a double"},
      {"words", "coeffs: []", "coeffs: many", "line 3: cam0 distortion_coeffs is not a list"},
      {"no resolution", "resolution", "size", "cam0 has no resolution"},
      {"eucm", "model: ds", "model: eucm", "camera_model eucm: the extended unified camera model"},
      {"omni", "model: ds", "model: omni", "camera_model omni: the omnidirectional unified"},
      {"neither", "model: ds", "model: dsx", "camera_model dsx; pinhole and ds can be read"}};
  for (const BadLens& fault : faults) {
    SCOPED_TRACE(fault.what);
    const std::string text = absl::StrReplaceAll(good, {{fault.from, fault.to}});
    ASSERT_NE(text, good);
    EXPECT_THAT(FaultOf(ReadKalibr("camchain.yaml", text)),
                AllOf(HasSubstr("camchain.yaml, line"), HasSubstr(fault.says)));
  }
}

TEST(DoubleSphere, FaultsOfBasaltsFilesAreNamed) {
  const std::string good = BasaltText(kWide, kSize);
  const BadLens faults[] = {
      {"no number", "\"xi\": -0.18", "\"xi\": null", "cam0 has no finite number xi"},
      {"alpha is missing", "\"alpha\"", "\"beta\"", "cam0 has no finite number alpha"},
      {"alpha too large", "\"alpha\": 0.59", "\"alpha\": 2", "alpha is 2"},
      {"distortion as well", "\"alpha\": 0.59", "\"alpha\": 0.59, \"k1\": 0.1", "has k1 beside"},
      {"no size", "[[752", "[[0", "no size of its image"},
      {"no sizes", "\"resolution\"", "\"size\"", "no size of its image"},
      {"no rotation", "\"qw\": 0.8", "\"qw\": 0.2", "quaternion is not of length 1"},
      {"half a pose", "\"pz\"", "\"pzz\"", "no finite number pz"},
      {"no lenses", "\"intrinsics\": [", "\"lenses\": [", "without a list of intrinsics"},
      {"cut off", "}}", "", "is not JSON"}};
  for (const BadLens& fault : faults) {
    SCOPED_TRACE(fault.what);
    const std::string text = absl::StrReplaceAll(good, {{fault.from, fault.to}});
    ASSERT_NE(text, good);
    EXPECT_THAT(FaultOf(ReadBasalt("calibration.json", text)),
                AllOf(HasSubstr("calibration.json"), HasSubstr(fault.says)));
  }
}

TEST(FitDoubleSphere, RefusesWhatNoLensOfOursShows) {
  EXPECT_THAT(FitDoubleSphere(kWholeSky, {512, 512}),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("90 degrees"), HasSubstr("at pixel ("))));
  // Between pixels there is no number.
  DoubleSphere bad = kWide;
  bad.cx_px = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(FitDoubleSphere(bad, kSize),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not finite")));
}

// 81 degrees in the corners: a polynomial of the angle is 0.29 px off there.
TEST(FitDoubleSphere, TakesARationalLensWhereAFisheyeIsNotNearEnough) {
  const DoubleSphere lens{
      .xi = -0.1, .alpha = 0.3, .fx_px = 150, .fy_px = 150, .cx_px = 375.5, .cy_px = 239.5};
  ASSERT_OK_AND_ASSIGN(const FittedLens fitted, FitDoubleSphere(lens, kSize));
  EXPECT_EQ(fitted.intrinsics.model, DistortionModel::kRational);
  EXPECT_LT(LargestDifferencePx(lens, fitted.intrinsics, kSize), kDoubleSphereWithinPx);
  ASSERT_OK_AND_ASSIGN(const FittedLens wide, FitDoubleSphere(kWide, kSize));
  EXPECT_EQ(wide.intrinsics.model, DistortionModel::kFisheye);
  EXPECT_LT(wide.largest_px, 0.01);
  EXPECT_GT(wide.largest_px, 0);
}

TEST(FitDoubleSphere, SaysByHowMuchAndWhereALensIsOff) {
  const DoubleSphere extreme{
      .xi = -0.6, .alpha = 0.5, .fx_px = 150, .fy_px = 150, .cx_px = 375.5, .cy_px = 239.5};
  EXPECT_THAT(FitDoubleSphere(extreme, kSize),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("(rational_polynomial) is off by 0.1"),
                             HasSubstr("px at pixel ("), HasSubstr("more than 0.1 px"))));
}

}  // namespace
}  // namespace rigcal::double_sphere_test
