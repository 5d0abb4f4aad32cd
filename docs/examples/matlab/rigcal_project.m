% SPDX-License-Identifier: Apache-2.0
function [pixels, jacobian] = rigcal_project(camera, points)
% RIGCAL_PROJECT  Pixels of points.
%   pixels = RIGCAL_PROJECT(camera, points), with an element of what rigcal_rig reads and N x 3
%   points in the rig frame (metres), is N x 2. NaN: behind the camera, or beyond a pole of the
%   rational model. MATLAB's first pixel is (1, 1): add 1.
%   [pixels, jacobian] also gives the derivative of one point's pixel by the point, 2 x 3.
%   Formulas: OpenCV, calib3d, projectPoints; its fisheye module.
  if size(points, 2) ~= 3
    error('rigcal:shape', 'points must be N x 3, not %d x %d', size(points, 1), size(points, 2));
  end
  pixels = project(camera, points);
  if nargout > 1
    % Complex step (Squire and Trapp 1998): exact to rounding, for a function without abs and norm.
    step = 1e-30;
    jacobian = zeros(2, 3);
    for i = 1:3
      moved = points(1, :);
      moved(i) = moved(i) + 1i * step;
      jacobian(:, i) = imag(project(camera, moved)).' / step;
    end
  end
end

function pixels = project(camera, points)
  inside = points * camera.R.' + camera.t.';
  z = inside(:, 3);
  x = inside(:, 1) ./ z;
  y = inside(:, 2) ./ z;
  k = camera.k;
  r2 = x .* x + y .* y;
  seen = real(z) > 0;
  if strcmp(camera.model, 'MODEL_FISHEYE')
    r = sqrt(r2);
    theta = atan(r);
    t2 = theta .* theta;
    gain = theta .* (1 + t2 .* (k(1) + t2 .* (k(2) + t2 .* (k(3) + t2 .* k(4))))) ./ r;
    gain(real(r2) < 1e-16) = 1;
    u = x .* gain;
    v = y .* gain;
  else
    pole = ones(size(r2));
    if strcmp(camera.model, 'MODEL_RATIONAL')
      pole = 1 + r2 .* (k(6) + r2 .* (k(7) + r2 .* k(8)));
    end
    radial = (1 + r2 .* (k(1) + r2 .* (k(2) + r2 .* k(5)))) ./ pole;
    u = x .* radial + 2 * k(3) * x .* y + k(4) * (r2 + 2 * x .* x);
    v = y .* radial + k(3) * (r2 + 2 * y .* y) + 2 * k(4) * x .* y;
    seen = seen & real(pole) > 0;
  end
  pixels = [u, v] .* camera.focal + camera.centre;
  pixels(~seen, :) = NaN;
end
