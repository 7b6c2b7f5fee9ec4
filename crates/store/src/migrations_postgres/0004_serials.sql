-- Serial comparisons are products.

ALTER TABLE products DROP CONSTRAINT products_kind_check;
ALTER TABLE products ADD CONSTRAINT products_kind_check CHECK (kind IN
    ('model', 'segmentation', 'template', 'reader', 'beat', 'comparison', 'serial', 'normals'));
ALTER TABLE holdings DROP CONSTRAINT holdings_kind_check;
ALTER TABLE holdings ADD CONSTRAINT holdings_kind_check CHECK (kind IN
    ('volume', 'model', 'segmentation', 'template', 'reader', 'beat', 'comparison', 'serial', 'normals'));
