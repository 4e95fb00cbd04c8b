% The paper's way in the language it was written in: threshold, Canny, fill, and the largest region that is left.
%
%   octave-cli octave_method.m FOLDER LEFT TOP RIGHT BOTTOM THRESHOLD PIVOT_X PIVOT_Y OUT.csv
%
% Reads every PNG of FOLDER in the order of their names. A row of OUT.csv is the tip of the mouth, the filled region's
% pixel farthest from the pivot, and that region's centroid, x and y each; NaN where nothing was found. Pixels are
% counted from 0. The last line of what is printed is the seconds it took, reading the pictures included.
pkg load image
arguments = argv();
[folder, out] = arguments{[1, end]};
numbers = str2double(arguments(2:end-1));
box = numbers(1:4);
threshold = numbers(5);
pivot = numbers(6:7)';

names = sort(glob(fullfile(folder, "*.png")));
found = nan(numel(names), 4);
tic
for k = 1:numel(names)
  picture = double(imread(names{k})(box(2)+1:box(4), box(1)+1:box(3), :));
  redness = picture(:, :, 1) - (picture(:, :, 2) + picture(:, :, 3)) / 2;
  filled = imfill(edge(double(redness > threshold), "Canny"), "holes");
  regions = regionprops(filled, "Area", "Centroid", "PixelList");
  if isempty(regions)
    continue
  end
  [~, largest] = max([regions.Area]);
  corner = box(1:2)' - 1;
  pixels = regions(largest).PixelList + corner;
  [~, farthest] = max(sumsq(pixels - pivot, 2));
  found(k, :) = [pixels(farthest, :), regions(largest).Centroid + corner];
end
seconds = toc;
dlmwrite(out, found, "precision", 10);
printf("%.6f\n", seconds);
