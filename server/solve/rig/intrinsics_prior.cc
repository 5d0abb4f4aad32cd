// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/intrinsics_prior.h"

#include "common/camera/intrinsics_vector.h"

namespace rigcal::server {

void SetIntrinsicsPrior(const CameraDescription& description, BundleCamera* camera,
                        const IntrinsicsPrior& prior) {
  camera->intrinsics_fixed = false;
  camera->intrinsics_mean = ToVector(*description.intrinsics);
  IntrinsicsVector& sigma = camera->intrinsics_sigma;
  sigma = IntrinsicsVector::Constant(camera->intrinsics_mean.size(), prior.radial_high);
  sigma[0] = prior.focal_share * camera->intrinsics_mean[0];
  sigma[1] = prior.focal_share * camera->intrinsics_mean[1];
  sigma[2] = sigma[3] = prior.centre_share * description.image_size_px.width;
  sigma[4] = sigma[5] = prior.radial;
  if (camera->model != DistortionModel::kFisheye) sigma[6] = sigma[7] = prior.tangential;
}

}  // namespace rigcal::server
