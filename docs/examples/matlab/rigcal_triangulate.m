% SPDX-License-Identifier: Apache-2.0
function points = rigcal_triangulate(rig, pixels, sigma_px)
% RIGCAL_TRIANGULATE  Points in 3-D, by least squares of the reprojection error.
%   points = RIGCAL_TRIANGULATE(rig, pixels, sigma_px), with C cameras, N x 2 x C pixels (NaN: not
%   seen) and 1 x C sigmas of a coordinate (pixels), is N x 3, metres, in the rig frame. NaN: fewer
%   than two cameras see it, or the search finds none. No view is left out, as rigcal does.
%   Gauss and Newton's method, from the point nearest to the rays.
  if size(pixels, 2) ~= 2 || size(pixels, 3) ~= numel(rig) || numel(sigma_px) ~= numel(rig)
    error('rigcal:shape', 'pixels must be N x 2 x %d, and sigma_px 1 x %d', numel(rig), numel(rig));
  end
  points = nan(size(pixels, 1), 3);
  for n = 1:size(pixels, 1)
    views = find(all(isfinite(reshape(pixels(n, :, :), 2, [])), 1));
    if numel(views) < 2
      continue
    end
    point = nearest(rig(views), reshape(pixels(n, :, views), 2, []).');
    for step = 1:20
      rows = zeros(2 * numel(views), 3);
      left = zeros(2 * numel(views), 1);
      for i = 1:numel(views)
        [seen, slope] = rigcal_project(rig(views(i)), point.');
        at = [2 * i - 1, 2 * i];
        rows(at, :) = slope / sigma_px(views(i));
        left(at) = (reshape(pixels(n, :, views(i)), 2, 1) - seen.') / sigma_px(views(i));
      end
      if ~all(isfinite([rows(:); left]))
        point = nan(3, 1);
        break
      end
      change = rows \ left;
      point = point + change;
      if norm(change) < 1e-12
        break
      end
    end
    points(n, :) = point.';
  end
end

function point = nearest(rig, pixels)
% The point with the least sum of squared distances from the rays, 3 x 1.
  normal = zeros(3);
  right = zeros(3, 1);
  for i = 1:numel(rig)
    ray = rig(i).R.' * [straight(rig(i), pixels(i, :)).'; 1];
    ray = ray / norm(ray);
    across = eye(3) - ray * ray.';
    normal = normal + across;
    right = right - across * rig(i).R.' * rig(i).t;
  end
  point = normal \ right;
end

function flat = straight(camera, pixel)
% x/z and y/z of a pixel, 1 x 2: Newton's method on the projection itself.
  alone = camera;
  alone.R = eye(3);
  alone.t = zeros(3, 1);
  flat = (pixel - camera.centre) ./ camera.focal;
  if strcmp(camera.model, 'MODEL_FISHEYE') && norm(flat) > 0
    flat = flat * tan(min(norm(flat), 1.4)) / norm(flat);
  end
  for step = 1:50
    [seen, slope] = rigcal_project(alone, [flat, 1]);
    change = (slope(:, 1:2) \ (pixel - seen).').';
    flat = flat + change;
    if norm(change) < 1e-13
      break
    end
  end
end
