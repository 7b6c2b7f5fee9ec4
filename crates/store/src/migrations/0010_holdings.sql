-- The age of a volume is its tenant's: how long ago that tenant last uploaded or used it.

-- What was stored while nothing wrote holdings yet belongs to the tenant of everybody.
INSERT INTO holdings (tenant, id, kind, created_at, renewed_at)
SELECT 'default', id, kind, created_at, created_at FROM (
    SELECT id, 'volume' AS kind, created_at, sequence FROM volumes
    UNION ALL SELECT id, kind, created_at, sequence FROM products) AS item
WHERE NOT EXISTS (SELECT 1 FROM holdings WHERE holdings.id = item.id)
ORDER BY created_at, sequence;

INSERT OR IGNORE INTO sources (tenant, id, volume)
SELECT holdings.tenant, products.id, products.volume
FROM products JOIN holdings USING (id) WHERE products.volume IS NOT NULL
UNION SELECT holdings.tenant, products.id, json_extract(parameters, '$.expert')
FROM products JOIN holdings USING (id)
WHERE json_extract(parameters, '$.expert') LIKE 'vol\_%' ESCAPE '\';

UPDATE holdings SET renewed_at = max(renewed_at,
    coalesce((SELECT used_at FROM volumes WHERE volumes.id = holdings.id), 0));

DROP INDEX volumes_by_use;
ALTER TABLE volumes DROP COLUMN used_at;
