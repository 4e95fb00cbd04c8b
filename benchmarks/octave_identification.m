% Identify a discrete model from each column of outputs with Octave's control package.
%
%   octave-cli octave_identification.m FOLDER METHOD ORDER INTERVAL
%
% METHOD is arx, moen4, moesp or n4sid. Reads FOLDER/u.csv (N x 1) and FOLDER/y.csv (N x seeds); a row of FOLDER/found.csv
% is the seconds it took, then A, B, C, D by columns; NaN where the method failed.
pkg load control
arguments = argv();
[folder, method] = arguments{1:2};
order = str2double(arguments{3});
interval = str2double(arguments{4});

u = csvread(fullfile(folder, "u.csv"));
y = csvread(fullfile(folder, "y.csv"));
found = nan(columns(y), 1 + (order + 1) ^ 2);
for k = 0:columns(y)
  data = iddata(y(:, max(k, 1)), u, interval);  % the first is done twice: whatever is loaded on first use
  tic
  try
    if strcmp(method, "arx")
      model = ss(arx(data, "na", order, "nb", order));
    else
      model = feval(method, data, order);
    end
    if k > 0
      model = model(1, 1);
      found(k, :) = [toc, model.a(:)', model.b(:)', model.c(:)', model.d(:)'];
    end
  catch failure
    fprintf(stderr, "%s: %s\n", method, failure.message);
  end
end
dlmwrite(fullfile(folder, "found.csv"), found, "precision", 17);
