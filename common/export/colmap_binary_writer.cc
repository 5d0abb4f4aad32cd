// SPDX-License-Identifier: Apache-2.0
// The same model as colmap_text_writer.cc in COLMAP's binary files, which are little-endian.
#include "common/export/colmap_model.h"
#include "common/export/format_writers.h"
#include "common/export/little_endian.h"

namespace rigcal {

ExportFiles WriteColmapBinary(const ExportedRig& rig) {
  std::string cameras, images, points;
  const uint64_t count = rig.cameras.size();
  AppendLittleEndian(count, &cameras);
  AppendLittleEndian(count, &images);
  AppendLittleEndian(uint64_t{0}, &points);
  uint32_t id = 0;
  for (const ExportedCamera& camera : rig.cameras) {
    ++id;
    const ColmapLens lens = ColmapLensOf(camera);
    AppendLittleEndian(id, &cameras);
    AppendLittleEndian(lens.model_id, &cameras);
    AppendLittleEndian(uint64_t{camera.image_size_px.width}, &cameras);
    AppendLittleEndian(uint64_t{camera.image_size_px.height}, &cameras);
    for (const double parameter : lens.parameters) AppendLittleEndian(parameter, &cameras);

    const Eigen::Quaterniond q = Canonical(camera.cam_from_rig.rotation);
    const Eigen::Vector3d& t = camera.cam_from_rig.translation_m;
    AppendLittleEndian(id, &images);
    for (const double value : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) {
      AppendLittleEndian(value, &images);
    }
    AppendLittleEndian(id, &images);
    images += ColmapImageOf(camera);
    images += '\0';
    AppendLittleEndian(uint64_t{0}, &images);  // points in the image
  }
  return std::vector<ExportFile>{{"cameras.bin", std::move(cameras)},
                                 {"images.bin", std::move(images)},
                                 {"points3D.bin", std::move(points)}};
}

}  // namespace rigcal
